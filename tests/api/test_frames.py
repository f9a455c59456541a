"""Data frames of pandas and polars, in and out."""

import numpy as np
import pytest

from mpucal import Calibration, MpucalError, Recording

N = 30
RANDOM = np.random.default_rng(3)
RECORDING = Recording.from_arrays(
    np.arange(N) / 50.0, RANDOM.normal(size=(N, 3)), RANDOM.normal(size=(N, 3)), gap=np.arange(N) == 4
)
CALIBRATION = Calibration(
    np.eye(3) + 0.1 * RANDOM.normal(size=(3, 3)), RANDOM.normal(size=3), b_omega=RANDOM.normal(size=3)
)


def test_names_without_units_are_taken_in_any_order():
    pandas = pytest.importorskip("pandas")
    columns = dict(zip(("gx", "gy", "gz", "ax", "ay", "az"), np.hstack([RECORDING.gyr, RECORDING.acc]).T, strict=True))
    made = Recording.from_dataframe(pandas.DataFrame({**columns, "t": RECORDING.t, "note": ["x"] * N}))
    np.testing.assert_array_equal(made.acc, RECORDING.acc)
    np.testing.assert_array_equal(made.gyr, RECORDING.gyr)
    with pytest.raises(MpucalError, match="lacks a column of ax, ay, az: name its columns ax or ax_mps2"):
        CALIBRATION.apply(pandas.DataFrame({"ax": [1.0], "ay": [1.0]}))


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_a_frame_is_calibrated_in_place_of_its_columns_and_comes_back_as_it_went(library):
    pytest.importorskip(library)
    frame = RECORDING.to_dataframe(library)
    assert list(frame.columns)[:5] == ["t_s", "ax_mps2", "ay_mps2", "az_mps2", "gx_rad_s"]
    applied = CALIBRATION.apply(frame)
    a, omega = CALIBRATION.apply(RECORDING.acc, RECORDING.gyr)
    assert type(applied) is type(frame) and list(applied.columns) == list(frame.columns)
    back = Recording.from_dataframe(applied)
    np.testing.assert_array_equal(back.acc, a)
    np.testing.assert_array_equal(back.gyr, omega)
    assert Recording.from_dataframe(frame) == RECORDING  # the frame itself is unchanged


def test_the_index_is_kept_and_gives_the_time():
    pandas = pytest.importorskip("pandas")
    frame = RECORDING.to_dataframe().drop(columns="t_s")
    frame.index = pandas.date_range("2026-03-01", periods=N, freq="20ms")
    np.testing.assert_allclose(Recording.from_dataframe(frame).t, RECORDING.t, atol=1e-12)
    assert CALIBRATION.apply(frame[["ax_mps2", "ay_mps2", "az_mps2"]]).index.equals(frame.index)
