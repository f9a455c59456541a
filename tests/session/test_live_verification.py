"""Reasons and verdicts that follow from rests in unseen orientations."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.verification import NewOrientation
from mpucal.data import Recording, Sensor
from mpucal.reasons import Reason
from mpucal.result.calibration import Calibration
from mpucal.session.events import Checked
from mpucal.session.live_verification import add_verification, judge_verification


def rest(magnitude=0.0, direction=0.0, turn=(1.2, 0.0, 0.0), miss=(0.0, 0.0, 0.0), clipped=False, std=0.005):
    down = np.array([0.0, 0.6, -0.8])
    return NewOrientation(down, magnitude, std, direction, np.radians(0.1), np.array(turn), np.array(miss), clipped)


def recording(warmer_c=0.0, acc_clipped=0, gyr_clipped=0, message=None):
    n = 1000
    marks = np.arange(n)
    return Recording.from_arrays(
        np.arange(n) / 100.0,
        np.zeros((n, 3)),
        np.zeros((n, 3)),
        temperature_c=25.0 + warmer_c * (np.arange(n) > n // 2),
        acc_clipped=marks < acc_clipped,
        gyr_clipped=marks < gyr_clipped,
        sensor=Sensor(message=message),
    )


CONTRADICTION = Reason("inconsistent", "the rests contradict each other", "fasten it", False)
TURNED = [rest(direction=0.05, turn=(0.0, 0.0, turn), miss=(0.0, 0.0, 0.04 * turn)) for turn in (1.2, -1.0, 1.5)]


# rests, their recording, a contradiction of the fit, the code of the reason, and words of it
VERIFIED = {
    "agree": ([rest(), rest(), rest()], recording(), None, "", ""),
    "length": ([rest(0.05), rest()], recording(), None, "verification_failed", "|a| is +0.050 m/s² off"),
    "knock": ([rest(0.05), rest()], recording(acc_clipped=3), None, "verification_failed", "after a knock"),
    "slip": ([rest(direction=0.06), rest()], recording(), None, "verification_failed", "the sensor moved on its mount"),
    "scale": (TURNED, recording(), None, "verification_failed", "scale factor about z differs by 4%"),
    "clipped": ([rest(clipped=True)], recording(gyr_clipped=50), None, "gyro_clipped", "every turn went beyond"),
    "some clipped": ([rest(0.05), rest()], recording(gyr_clipped=50), None, "gyro_clipped", "beyond the gyroscope's"),
    "warm": ([rest()], recording(warmer_c=15.0), None, "temperature_moved", "rose by 15 C"),
    "cold": ([rest()], recording(warmer_c=-12.0), None, "temperature_moved", "fell by 12 C"),
    "a vehicle": ([rest()], recording(15.0, message="RAW_IMU"), None, "temperature_moved", "vehicle lay flat"),
    "rests": ([rest()], recording(), CONTRADICTION, "inconsistent", "contradict"),
    "rests after a knock": ([rest()], recording(acc_clipped=3), CONTRADICTION, "inconsistent", "knocked the board"),
}


@pytest.mark.parametrize(("rests", "data", "contradiction", "code", "words"), VERIFIED.values(), ids=VERIFIED)
def test_the_likeliest_reason_is_given(rests, data, contradiction, code, words):
    checked = judge_verification(rests, rests, 3, data, contradiction)
    assert checked.agrees == (code == "")
    if code:
        assert checked.reason.code == code
        assert words in checked.reason.what
        assert checked.reason.remedy
    else:
        assert checked.reason is None
    assert len(checked.verifications) == len(rests)


def test_no_orientation_that_was_still_enough_refuses_nothing():
    checked = judge_verification([], [], 1, recording(), None)
    assert (checked.agrees, checked.reason.refuse) == (None, False)
    assert "held still in 0 of 1 orientations" in checked.reason.what


@pytest.mark.parametrize(
    ("rests", "contradiction", "agrees", "code"),
    [
        ([rest()], CONTRADICTION, False, "inconsistent"),
        ([rest(0.3, std=0.2)], None, None, "verification_failed"),
    ],
    ids=["contradiction", "an error that could not have been seen"],
)
def test_agreement_that_tells_little_is_doubtful(rests, contradiction, agrees, code):
    checked = judge_verification(rests, rests, 1, recording(), contradiction)
    assert (checked.agrees, checked.reason.code, checked.doubtful) == (agrees, code, True)
    assert not judge_verification([rest(0.05)], [rest(0.05)], 1, recording(), contradiction).doubtful


MOVED = Reason("verification_failed", "it moved", "fasten it", True)


def calibration(verdict="usable"):
    zeros = np.zeros(3)
    reasons = [{"code": "few_orientations", "message": "too few"}]
    return Calibration(np.eye(3), zeros, np.zeros((3, 3)), zeros, quality={"verdict": verdict, "reasons": reasons})


def test_a_disagreement_refuses_and_comes_first():
    found = add_verification(calibration(), Checked((), False, MOVED))
    assert found.verdict == "refused"
    assert [reason["code"] for reason in found.quality["reasons"]] == ["verification_failed", "few_orientations"]
    assert found.quality["reasons"][0] == MOVED.document()
    assert not found.quality["verification"]["agrees"]


@pytest.mark.parametrize(
    ("first", "final"),
    [("few_orientations", "zero_moved"), ("zero_moved", "few_orientations"), ("inconsistent", "zero_moved")],
)
def test_no_more_orientations_are_asked_for_where_a_fit_found_that_the_sensor_changed(first, final):
    of_all = replace(calibration(), quality={"verdict": "usable", "reasons": [{"code": final, "message": "it"}]})
    found = add_verification(of_all, Checked((), False, Reason(first, "it is so", "do that", True)))
    assert found.verdict == "refused"
    assert [reason["code"] for reason in found.quality["reasons"]] == ["zero_moved"]


@pytest.mark.parametrize(("verdict", "then"), [("good", "usable"), ("usable", "usable"), ("refused", "refused")])
def test_an_unverified_calibration_is_usable_at_most(verdict, then):
    found = add_verification(calibration(verdict), Checked((), None, MOVED))
    assert found.verdict == then
    assert found.quality["reasons"][0]["message"] == "it moved; fasten it"
    assert found.quality["verification"] == {"agrees": None, "orientations": []}
