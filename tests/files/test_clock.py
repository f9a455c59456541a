"""A file whose stamps are those of arrival has the sensor's own clock, whole and in runs."""

import numpy as np
import pytest

import mpucal
from mpucal.files import open_rows


@pytest.mark.parametrize("ending", [".csv", ".npz"])
def test_a_recording_by_radio_is_the_one_by_wire_also_in_runs(ending, walk, table, tmp_path):
    """Estimate the clock as `calibrate` does and as `apply` does, without a gap at each late stamp."""
    # in bursts of four as well, each with one stamp
    last = np.minimum((np.arange(len(walk)) // 4 + 1) * 4 - 1, len(walk) - 1)
    stamps = np.maximum.accumulate(walk.t + np.random.default_rng(6).exponential(4e-3, len(walk)))[last]
    if ending == ".npz":
        np.savez(tmp_path / "walk.npz", t=stamps, acc=walk.acc, gyr=walk.gyr)
    else:
        table("t,ax,ay,az,gx,gy,gz", stamps, walk.acc, walk.gyr)
    read, runs = mpucal.load(tmp_path / f"walk{ending}"), open_rows(tmp_path / f"walk{ending}")
    off = read.t - walk.t
    assert np.abs(off - np.median(off)).max() < 2e-3
    assert "arrival stamps" in read.taken
    assert runs.taken == read.taken
    np.testing.assert_array_equal(np.concatenate([samples.t for samples in runs.runs]), read.t)
