"""Whole files without a recording in them: a dead sensor, one sample over and over, no samples, times that are none."""

import numpy as np
import pandas as pd
import pytest

import mpucal
from mpucal.errors import RecordingError
from mpucal.files import open_rows

N = 40
NAMES = ["t [s]", *(f"a{axis} [m/s^2]" for axis in "xyz"), *(f"g{axis} [rad/s]" for axis in "xyz")]
TIMES = np.arange(N) / 100
AT_REST = np.tile([0.0, 0.0, 9.8, 0.0, 0.0, 0.0], (N, 1))
FIRST = np.arange(N) == 0
DATES = pd.Series(pd.to_datetime(np.arange(N) * 10_000_000)).to_numpy()


def table(times=TIMES):
    made = pd.DataFrame(AT_REST, columns=NAMES[1:])
    made.insert(0, NAMES[0], times)
    return made


def test_a_sensor_that_counts_zeros_measures_no_gravity(tmp_path):
    (tmp_path / "dead.txt").write_text("a/g:\t0\t0\t0\t0\t0\t0\n" * N)
    with pytest.raises(RecordingError, match=r"at ±2 g the median \|a\| is 0 m/s\^2, which is not gravity"):
        mpucal.load(tmp_path / "dead.txt", rate=100)


ONE = "repeats one sample at one time: record it again"


@pytest.mark.parametrize(
    ("times", "says"),
    [
        (np.where(FIRST, np.datetime64("NaT"), DATES), "t.* lacks a time"),
        (np.where(FIRST, np.inf, TIMES), "times that are not finite"),
        (np.full(N, np.inf), "times that are not finite"),
        (np.where(FIRST, -1.7e308, 1.7e308 + TIMES), f"times that are not finite|{ONE}"),
        (np.zeros(N), ONE),
        (["2026-11-22T12:00:00"] * N, ONE),
        (np.arange(1, N + 1) * 5e-324, "t has steps of 4.94066e-324 s"),
        (np.arange(1, N + 1) * 1e-13, "t has steps of 1e-13 s"),
    ],
)
def test_times_that_are_no_times_are_refused(times, says, tmp_path):
    if isinstance(times, list):
        table(times).to_csv(tmp_path / "a.csv", index=False)
    else:
        table(times).to_parquet(tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match=says):
        mpucal.load(tmp_path / ("a.csv" if isinstance(times, list) else "a.parquet"), units="t=s,gyr=rad/s")


def test_times_in_small_integers_do_not_wrap(tmp_path, walk):
    n = 4 * len(walk)  # 40 s
    made = pd.DataFrame(np.tile(np.column_stack([walk.acc, walk.gyr]), (4, 1)), columns=NAMES[1:])
    made.insert(0, "t [ms]", (np.arange(n) * 10 - 20_000).astype(np.int16))
    made.to_parquet(tmp_path / "a.parquet")
    np.testing.assert_allclose(mpucal.load(tmp_path / "a.parquet").t, np.arange(n) / 100, atol=1e-12)
    made[:0].to_parquet(tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match="holds 0 accelerations: record for longer"):
        mpucal.load(tmp_path / "a.parquet")


def test_a_nan_that_signals_is_a_nan(tmp_path):
    """Read a float32 of which NumPy warns where it becomes a float64."""
    signalling = np.where(np.arange(N) == 7, 0x7F800001, 0x3F800000).astype(np.uint32).view(np.float32)
    acc = np.tile(signalling[:, None], (1, 3))
    np.savez(tmp_path / "a.npz", t=TIMES, acc=acc, gyr=AT_REST[:, 3:])
    assert len(mpucal.load(tmp_path / "a.npz")) == N - 1
    (samples,) = open_rows(tmp_path / "a.npz").runs
    assert np.flatnonzero(np.isnan(samples.acc[:, 0])).tolist() == [7]
    table().assign(**{"ax [m/s^2]": signalling, "temperature_c": signalling}).to_parquet(tmp_path / "a.parquet")
    assert len(mpucal.load(tmp_path / "a.parquet", units="gyr=rad/s")) == N - 1
