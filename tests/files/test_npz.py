from pathlib import Path

import numpy as np
import pytest

from mpucal.data import Sensor
from mpucal.errors import RecordingError
from mpucal.files import load

N = 50


@pytest.fixture
def arrays():
    random = np.random.default_rng(1)
    return {"t": np.arange(N) / 100, "acc": random.normal(size=(N, 3)), "gyr": random.normal(size=(N, 3))}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "made.npz"


def test_what_is_not_there_is_unknown(arrays, path):
    np.savez(path, **arrays, units="s, m/s^2, rad/s", notes="ignored")
    read = load(path)
    assert read.flat is None
    assert read.sensor == Sensor()
    assert np.isnan(read.temperature_c).all()
    assert not (read.gap | read.acc_clipped | read.gyr_clipped).any()


@pytest.mark.parametrize(
    ("extra", "flat"),
    [({"flat": (5, 15)}, (5, 15)), ({"flat_samples": 20}, (0, 20)), ({"flat_samples": [20]}, (0, 20))],
    ids=["a range", "how many", "how many, in a list"],
)
def test_the_flat_part(arrays, path, extra, flat):
    np.savez(path, **arrays, **extra)
    assert load(path).flat == flat


@pytest.mark.parametrize(
    ("change", "says"),
    [
        pytest.param({"gyr": None}, "so gravity is not in it", id="no gyr"),
        pytest.param({"acc": np.zeros((N, 2))}, r"made\.npz: acc has shape \(50, 2\)", id="two columns"),
        pytest.param({"t": np.zeros(N)}, "time does not increase at sample 1", id="time stands still"),
        pytest.param({"acc": np.full((N, 3), np.nan)}, "lacks a number in every sample", id="NaN"),
        pytest.param({"t": np.array(["a"] * N)}, "t holds values that are not numbers", id="words"),
        pytest.param({"flat": (1, 2, 3)}, "flat is", id="flat of three"),
        pytest.param({"flat": (40, 60)}, "does not lie within", id="flat beyond the end"),
        pytest.param({"flat_samples": np.nan}, "flat_samples is nan", id="flat NaN"),
        pytest.param({"temperature": np.zeros(3)}, "temperature_c has shape", id="temperature too short"),
        pytest.param({"sensor": "MPU"}, "sensor is not a JSON object", id="sensor no JSON"),
        pytest.param({"sensor": "[1]"}, "sensor is not a JSON object", id="sensor a list"),
    ],
)
def test_arrays_that_are_no_recording(arrays, path, change, says):
    np.savez(path, **{key: value for key, value in (arrays | change).items() if value is not None})
    with pytest.raises(RecordingError, match=says):
        load(path)


def test_files_that_are_no_archive(arrays, path, tmp_path):
    np.savez_compressed(path, **arrays)
    whole = path.read_bytes()
    broken = bytearray(whole)
    broken[len(whole) // 2] ^= 0xFF
    np.save(tmp_path / "one.npy", arrays["t"])
    contents = [b"", b"t,acc,gyr", whole[:-30], whole[: len(whole) // 2], bytes(broken)]
    for content in [*contents, (tmp_path / "one.npy").read_bytes()]:
        path.write_bytes(content)
        with pytest.raises(RecordingError, match="not a whole NumPy archive"):
            load(path)


def test_an_archive_of_objects_runs_no_code(arrays, path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("a pickle was loaded",))

    np.savez(path, **(arrays | {"t": np.array([Trap()], dtype=object)}))
    with pytest.raises(RecordingError, match="allow_pickle=False"):
        load(path)


def test_real_and_simulated_recordings_of_others_are_read():
    shared = Path(__file__).parents[2].parent / "shared"
    paths = sorted([*shared.glob("recordings/*.npz"), *shared.glob("simulated/*.npz")])
    if not paths:
        pytest.skip("the folder shared with recordings of others is not beside the project")
    for path in paths:
        with np.load(path) as archive:
            recording = load(path)
            np.testing.assert_array_equal(recording.acc, archive["acc"])
            assert recording.flat == ((0, archive["flat_samples"]) if "flat_samples" in archive else None)
