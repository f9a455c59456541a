from dataclasses import fields

import numpy as np
import pytest

from mpucal.data import Recording, Samples
from mpucal.errors import RecordingError

N = 6


def made(**change):
    given = {
        "t": np.arange(N) / 100,
        "acc": np.arange(3.0 * N).reshape(N, 3),
        "gyr": np.zeros((N, 3)),
    } | change
    return Recording.from_arrays(**given)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        pytest.param({"t": []}, r"t has shape \(0,\)", id="nothing"),
        pytest.param({"t": [0.0], "acc": [[0] * 3], "gyr": [[0] * 3]}, r"t has shape \(1,\)", id="one sample"),
        pytest.param({"t": np.zeros((N, 1))}, "t has shape", id="t two-dimensional"),
        pytest.param({"t": ["a"] * N}, "t holds values that are not numbers", id="t words"),
        pytest.param({"acc": [[1, 2], [3]]}, "acc holds values that are not numbers", id="ragged"),
        pytest.param({"acc": np.zeros((3, N))}, "acc has shape", id="acc transposed"),
        pytest.param({"gyr": np.zeros((N - 1, 3))}, "gyr has shape", id="gyr one short"),
        pytest.param({"acc": np.diag([np.nan] * 3).repeat(2, 0)}, "acc is not a finite number in 6 of 6", id="NaN"),
        pytest.param({"gyr": np.full((N, 3), np.inf)}, "gyr is not a finite number", id="infinite"),
        pytest.param({"t": np.full(N, np.nan)}, "t is not a finite number", id="t NaN"),
        pytest.param({"t": [0, 1, 2, 2, 3, 4]}, r"increase at sample 3 \(2.000000 s, then 2.000000", id="t stands"),
        pytest.param({"t": [0, 1, 2, 3, 4, 3]}, "increase at sample 5", id="t back"),
        pytest.param({"flat": (0, N + 1)}, "does not lie within its 6 samples", id="flat beyond"),
        pytest.param({"flat": (3, 3)}, "does not lie within", id="flat empty"),
        pytest.param({"flat": (-1, 3)}, "does not lie within", id="flat before"),
        pytest.param({"temperature_c": [20.0]}, "temperature_c has shape", id="one temperature"),
        pytest.param({"gap": [True]}, "gap has shape", id="one gap"),
    ],
)
def test_arrays_that_are_no_recording_are_refused(change, says):
    with pytest.raises(RecordingError, match=says) as raised:
        made(name="x.npz", **change)
    assert str(raised.value).startswith("x.npz: ")


@pytest.mark.parametrize(
    ("first", "last", "flat"),
    [(0, 6, (1, 4)), (1, 4, (0, 3)), (2, 6, (0, 2)), (0, 3, (1, 3)), (4, 6, None), (0, 1, None)],
)
def test_a_part_takes_its_share_of_the_flat_samples(first, last, flat):
    part = made(flat=(1, 4), gap=[0, 0, 1, 0, 0, 0], name="whole").part(first, last)
    assert len(part) == last - first
    assert part.flat == flat
    assert part.name == "whole"
    np.testing.assert_array_equal(part.t, made().t[first:last])
    np.testing.assert_array_equal(part.gap, np.array([0, 0, 1, 0, 0, 0], bool)[first:last])


def test_parts_joined_are_the_whole():
    whole = made(temperature_c=np.arange(N), gap=np.arange(N) % 2)
    joined = Samples.joined([whole.part(0, 2), Samples.empty(), whole.part(2, 3), whole.part(3, N)])
    assert len(joined) == N
    for field in fields(Samples):
        np.testing.assert_array_equal(getattr(joined, field.name), getattr(whole, field.name))
        assert getattr(joined, field.name).dtype == getattr(whole, field.name).dtype
