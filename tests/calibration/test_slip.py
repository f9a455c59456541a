"""Slip of the mount: found and reported as such; a lost turn is not taken for one, but near the end."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mpucal.calibration import calibrate, estimate
from mpucal.calibration.rotation import rotation
from mpucal.calibration.slip import end_slips
from mpucal.calibration.transitions import Transition
from tools.lab.scenarios import faults
from tools.lab.scenarios.family import Family, drawn

G = 9.82


AXIS = np.array([0.6, -0.6, 0.53]) / np.linalg.norm([0.6, -0.6, 0.53])


def slipped(recording, at_s, degrees=3.0):
    """Rotate the accelerometer against the gyroscope from `at_s` [s] on."""
    R, after = rotation(np.radians(degrees) * AXIS), recording.t >= recording.t[0] + at_s
    return replace(recording, acc=np.where(after[:, None], recording.acc @ R.T, recording.acc))


@pytest.mark.parametrize(("seed", "at_s"), [(2, 30.0), (3, 33.0), (4, 28.0)])
def test_a_mount_that_slips_between_rests_is_reported_with_its_time(hand, seed, at_s):
    calibration = calibrate(slipped(hand(seed, "pose12").recording, at_s), "auto", G)
    (reason,) = calibration.quality["reasons"]
    assert (calibration.verdict, reason["code"]) == ("refused", "inconsistent")
    begin, end = map(float, re.findall(r"(\d+) s", reason["message"]))
    assert begin - 1.0 <= at_s <= end + 1.0


@pytest.mark.parametrize("seed", [11, 14, 25, 31])
def test_a_slip_that_the_gyroscope_s_matrix_could_hide_is_reported(seed):
    """Any hand and sensor; a K that is estimated without the slip explains most of it."""
    simulated = drawn(Family("a mount slips", faults=(partial(faults.slip, deg=1.5),)), seed)
    calibration = calibrate(simulated.recording, "auto", simulated.truth.gravity)
    (reason,) = calibration.quality["reasons"]
    assert (calibration.verdict != "good", reason["code"]) == (True, "inconsistent")
    assert "the sensor was not the same before" in reason["message"]


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_slip_too_small_to_matter_is_within_the_uncertainty_of_a_good_calibration(hand, seed):
    simulated = hand(seed, "pose12")
    calibration = calibrate(slipped(simulated.recording, 30.0, degrees=0.1), "auto", G)
    assert calibration.verdict == "good"
    before = simulated.truth.D
    away = [abs(calibration.D - D) / calibration.D_std for D in (before, rotation(np.radians(0.1) * AXIS) @ before)]
    assert np.max(away) < 4.5


@pytest.mark.parametrize("motion", ["continuous", "pose12", "pose7"])
def test_a_mount_that_holds_does_not_slip(hand, motion):
    assert estimate(hand(1, motion).recording, "auto", G)[0].fit.slip is None


def test_a_turn_that_the_gyroscope_lost_is_no_slip(hand):
    """Two seconds without rates, in the middle of a recording, in which the board goes on turning."""
    recording = hand(1, "pose12").recording
    lost = abs(recording.t - recording.t[0] - 27.0) < 1.0
    gyr = np.where(lost[:, None], 0.0, recording.gyr)
    assert estimate(replace(recording, gyr=gyr), "auto", G)[0].fit.slip is None


@pytest.mark.parametrize(("seed", "degrees"), [(6, 3.0), (7, 3.0), (6, 12.0), (7, 25.0)])
def test_a_slip_in_the_last_turn_is_no_turn_that_the_gyroscope_lost(hand, seed, degrees):
    made = hand(seed, "pose12")
    calibration = calibrate(slipped(made.recording, 47.2, degrees), gravity=made.truth.gravity)
    assert [reason["code"] for reason in calibration.quality["reasons"]] == ["inconsistent"]
    begin, end = map(float, re.findall(r"[\d.]+", calibration.quality["reasons"][0]["message"])[:2])
    assert begin - 1.0 < 47.2 < end + 1.0


@pytest.mark.parametrize("seed", [6, 7, 8])
def test_a_slip_in_the_last_rest_divides_it(hand, seed):
    """A second before the end, 4 deg, while the hand holds the board: gravity turns, and the gyroscope does not."""
    made = hand(seed, "pose12")
    recording = made.recording
    calibration = calibrate(slipped(recording, recording.t[-1] - recording.t[0] - 1.0, 4.0), gravity=made.truth.gravity)
    assert (calibration.verdict, [reason["code"] for reason in calibration.quality["reasons"]]) == (
        "refused",
        ["inconsistent"],
    )


@pytest.mark.parametrize("seed", [1, 2, 6, 8])
def test_a_small_slip_in_the_last_rest_is_reported(hand, seed):
    """Slip by 1 deg, as little as a hand sways, but a hand's sway shows in the rates."""
    made = hand(seed, "pose12")
    recording = made.recording
    assert calibrate(recording, gravity=made.truth.gravity).verdict == "good"
    calibration = calibrate(slipped(recording, recording.t[-1] - recording.t[0] - 1.0, 1.0), gravity=made.truth.gravity)
    assert [reason["code"] for reason in calibration.quality["reasons"]] == ["inconsistent"]


@pytest.mark.parametrize("seed", [2, 3])
def test_a_small_slip_in_the_last_rest_but_one_is_reported_with_its_time(hand, seed):
    """Slip by 1 deg in the middle of the rest from 44 s to 46 s: the turns before and after it show half each."""
    made = hand(seed, "pose12")
    (reason,) = calibrate(slipped(made.recording, 45.4, 1.0), gravity=made.truth.gravity).quality["reasons"]
    begin, end = map(float, re.findall(r"(\d+) s", reason["message"])[:2])
    assert reason["code"] == "inconsistent"
    assert begin < 45.4 < end < begin + 4.0


def test_a_miss_near_the_end_that_the_next_one_undoes_is_no_slip():
    """Simulate twenty turns with random misses: a rest held askew causes two opposite misses, and a slip one."""
    rng = np.random.default_rng(3)
    F = [rotation(rng.normal(0.0, 1.0, 3)) for _ in range(20)]
    askew = 0.03 * np.array([0.6, -0.6, 0.53])
    for back, least, most in ((0.0, 0.9, 1.0), (1.0, 0.0, 0.1)):
        misses = rng.normal(0.0, 1e-3, (20, 3))
        misses[18] += askew
        misses[19] -= back * F[19] @ askew
        turns = [Transition(slice(0, 1), R, AXIS, AXIS, miss, 1e-6, 1e-7) for R, miss in zip(F, misses, strict=True)]
        ends = end_slips(turns, np.zeros(1, bool))
        assert least < ends.max() <= most
