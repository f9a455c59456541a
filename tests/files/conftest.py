"""A session's samples, which tests write in the dialects of other programs."""

from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.files import load
from mpucal.files.hints import NO_HINTS

FIXTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
EPOCH_NS = 1_403_636_579_758_555_392


@pytest.fixture(scope="session")
def walk():
    """A recording in which a hand turns the board, from t = 0 on, in steps of whole ns, 14 s of it."""
    whole = mpucal.load(FIXTURE).part(1000, 2400)
    t_ns = np.rint((whole.t - whole.t[0]) * 1e9).astype(np.int64)
    return mpucal.Recording.from_arrays(t_ns * 1e-9, whole.acc, whole.gyr, name="walk")


@pytest.fixture(scope="session")
def walk_ns(walk):
    """Times of the walk, (n,) ns since 1970."""
    return np.rint(walk.t * 1e9).astype(np.int64) + EPOCH_NS


@pytest.fixture(scope="session")
def assert_same():
    """Return a check that samples are those of the walk, but for what the dialect rounds."""

    def check(read, walk, acc=1e-12, gyr=1e-12, t=1e-12):
        assert len(read) == len(walk)
        np.testing.assert_allclose(read.t - read.t[0], walk.t, rtol=0, atol=t)
        np.testing.assert_allclose(read.acc, walk.acc, rtol=0, atol=acc)
        np.testing.assert_allclose(read.gyr, walk.gyr, rtol=0, atol=gyr)

    return check


@pytest.fixture
def load_table(tmp_path):
    """Return a function that writes a table as walk.csv, with words for pandas, and loads it."""

    def load_table(table, hints=NO_HINTS, **written):
        table.to_csv(tmp_path / "walk.csv", index=False, **written)
        return load(tmp_path / "walk.csv", hints)

    return load_table
