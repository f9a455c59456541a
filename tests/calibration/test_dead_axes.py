"""An accelerometer that dies while the board is turned is refused, and what is written of it is read again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal import load
from mpucal.calibration import calibrate
from mpucal.result.calibration import REFUSED, Calibration

WALK = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"


@pytest.fixture(scope="module")
def recording():
    return load(WALK)


@pytest.mark.parametrize(("axes", "from_s"), [([2], 4.7), ([0, 1, 2], 14.1)])
def test_one_that_dies(recording, axes, from_s, tmp_path):
    acc = recording.acc.copy()
    acc[np.ix_(recording.t - recording.t[0] > from_s, axes)] = 0.0
    found = calibrate(replace(recording, acc=acc))
    assert found.verdict == REFUSED
    found.save(tmp_path / "calibration.json")
    assert Calibration.load(tmp_path / "calibration.json") == found
