"""Estimation from a part of a recording: of a sensor that changed midway, the part by which the sensor is known."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.data import Recording
from tools.lab.judge import judged
from tools.lab.scenarios.course import arcs
from tools.lab.scenarios.family import drawn
from tools.lab.scenarios.table import FAMILIES

G = 9.82


def test_an_axis_that_freezes_late_leaves_the_part_before(hand):
    made = hand(1, "pose12")
    acc = made.recording.acc.copy()
    frozen = len(acc) * 9 // 10
    acc[frozen:, 2] = acc[frozen, 2]
    calibration = calibrate(replace(made.recording, acc=acc), "auto", G)
    (reason,) = calibration.quality["reasons"]
    assert (calibration.verdict, reason["code"]) == ("usable", "bits_stuck")
    assert "from what was recorded before" in reason["message"]
    assert judged(calibration, (made.truth.D, made.truth.b_a)).farthest < 4.0


@pytest.mark.parametrize("share", [0.01, 0.02])
def test_a_sensor_that_changed_is_calibrated_as_it_is_now(hand, share):
    """Turn the board, turn it back until it lies flat, and turn it once more after its scale changed."""
    made = hand(1, "pose12")
    r, b_a = made.recording, made.truth.b_a
    changed = (1.0 + share) * (r.acc - b_a) + b_a
    acc, gyr = np.concatenate([r.acc, r.acc[::-1], changed]), np.concatenate([r.gyr, -r.gyr[::-1], r.gyr])
    calibration = calibrate(Recording.from_arrays(np.arange(len(acc)) / r.rate_hz, acc, gyr), "auto", G)
    (reason,) = calibration.quality["reasons"]
    assert (calibration.verdict, reason["code"]) == ("usable", "inconsistent")
    assert "from what was recorded after" in reason["message"]
    assert "what precedes" in calibration.fit["why"]
    assert judged(calibration, ((1.0 + share) * made.truth.D, b_a)).farthest < 4.0


@pytest.mark.parametrize(("turns", "seed"), [(6, 3), (10, 2)])
def test_a_gyroscope_that_feels_acceleration_is_found_without_rests(turns, seed):
    """Turn the sensor slowly on a machine: without the sensitivity, both are good, and 13 and 6 sigma off."""
    family = FAMILIES["turntable whose acceleration the gyroscope feels"]
    made = drawn(replace(family, motion=partial(arcs, count=turns)), seed)
    calibration = calibrate(made.recording, "auto", made.truth.gravity)
    assert calibration.verdict == "good"
    assert judged(calibration, (made.truth.D, made.truth.b_a)).farthest < 3.0
    assert np.abs(calibration.D - made.truth.D).max() < 1e-3


def test_a_gyroscope_that_walks_and_feels_acceleration_is_explained_by_both():
    """Turn a sensor on a machine, with a walk of 0.003 deg/s in a second: one of them alone left 5 sigma."""
    family = FAMILIES["turntable whose acceleration the gyroscope feels"]
    made = drawn(replace(family, motion=partial(arcs, count=6)), 2)
    r = made.recording
    steps = np.random.default_rng(2).normal(0.0, np.radians(0.003) / np.sqrt(r.rate_hz), r.gyr.shape)
    calibration = calibrate(replace(r, gyr=r.gyr + np.cumsum(steps, axis=0)), "auto", made.truth.gravity)
    assert calibration.verdict == "good"
    assert judged(calibration, (made.truth.D, made.truth.b_a)).farthest < 3.0
