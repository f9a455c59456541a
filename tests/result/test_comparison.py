"""Two calibrations compared: the same as often as promised, and otherwise by how much they differ."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mpucal
from mpucal.data import Sensor
from mpucal.result.calibration import Calibration
from mpucal.result.comparison import CONFIDENCE, compare, is_better, worst_magnitude_error
from tools.lab.halves import halves

DRAWS = 500

D_STD = np.full((3, 3), 2e-4) * [[1.0, 0.5, 2.0], [0.7, 1.5, 0.3], [1.1, 0.9, 0.4]]
B_STD = np.array([0.004, 0.01, 0.02])
TRUTH = Calibration(
    np.eye(3) + 0.01 * np.arange(9).reshape(3, 3),
    np.array([0.3, -0.2, 1.1]),
    D_STD,
    B_STD,
    b_omega=np.zeros(3),
    b_omega_std=np.full(3, 1e-4),
    quality={"verdict": "good", "reasons": []},
    fit={"gravity": 9.80665},
)


def drawn(rng, scale=1.0):
    noise = {
        "D": TRUTH.D + scale * rng.normal(size=(3, 3)) * D_STD,
        "b_a": TRUTH.b_a + scale * rng.normal(size=3) * B_STD,
    }
    return replace(TRUTH, **noise)


def test_one_sensor_is_called_the_same_as_often_as_promised():
    rng = np.random.default_rng(8)
    same = np.mean([compare(drawn(rng), drawn(rng)).same for _ in range(DRAWS)])
    assert same == pytest.approx(CONFIDENCE, abs=3 * np.sqrt(CONFIDENCE * (1 - CONFIDENCE) / DRAWS))


@pytest.mark.parametrize(("model", "least", "most"), [("hand", 0.0, 0.01), ("accel", 0.01, 0.05)])
def test_deviations_that_few_turns_tell_count_as_such(model, least, most):
    """The standard deviations of a hand's calibration are estimated from a dozen turns, and so uncertain."""
    rng = np.random.default_rng(9)

    def by_hand():
        told = np.sqrt(rng.chisquare(12) / 12)
        return replace(drawn(rng), D_std=told * D_STD, b_a_std=told * B_STD, fit={**TRUTH.fit, "model": model})

    share = np.mean([compare(by_hand(), by_hand()).same is False for _ in range(DRAWS)])
    assert least <= share < most


def test_changed_parameters_are_named():
    moved = replace(TRUTH, b_a=TRUTH.b_a + np.array([0.0, 0.098, 0.0]))
    found = compare(TRUTH, moved)
    assert found.same is False
    assert [d.name for d in found.changed] == ["bias y"]
    assert found.changed[0].value == pytest.approx(0.098 / 9.80665 * 1000)
    assert found.changed[0].std == pytest.approx(np.sqrt(2) * 0.01 / 9.80665 * 1000)


@pytest.mark.parametrize(
    ("claims", "verdict", "same", "changed", "doubtful"),
    [
        (2.0, "usable", True, 0, 0),
        (5.0, "usable", None, 0, 1),
        (11.0, "usable", False, 1, 0),
        (5.0, "good", False, 1, 0),
    ],
)
def test_a_calibration_with_reservations_may_be_too_sure(claims, verdict, same, changed, doubtful):
    moved = replace(TRUTH, b_a=TRUTH.b_a + np.array([0.0, claims * np.sqrt(2) * B_STD[1], 0.0]))
    found = compare(TRUTH, replace(moved, quality={"verdict": verdict, "reasons": [{"code": "gyro_clipped"}]}))
    assert found.same is same
    assert (len(found.changed), len(found.doubtful)) == (changed, doubtful)
    assert any("B is usable (gyro_clipped)" in remark for remark in found.remarks) == (verdict == "usable")


def test_the_frame_makes_no_difference():
    """Compare one sensor in two frames 5 deg apart; K holds the rotation."""
    c, s = np.cos(np.radians(5.0)), np.sin(np.radians(5.0))
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned = replace(TRUTH, K=R @ TRUTH.K, D=TRUTH.D @ R.T)
    assert max(abs(d.value) for d in compare(TRUTH, turned).numbers) < 1e-9


def test_without_uncertainties_nothing_is_claimed():
    blob = Calibration.from_blob(TRUTH.blob())
    assert compare(blob, blob).same is None


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"sensor": Sensor(who_am_i=0x70)}, "of two chips"),
        ({"sensor": Sensor(temperature_c=22.5)}, "mpucal merge"),
        ({"fit": {"gravity": 9.81}}, r"scale factors by \+0.034 %"),
        ({"extra": {"autopilot": {"params_old": {"INS_ACCOFFS_X": 1.0}}}}, "parameters of the autopilot"),
    ],
)
def test_other_differences_are_remarked_on(change, says):
    first = replace(TRUTH, sensor=Sensor(who_am_i=0x68, temperature_c=20.0, accel_offsets=(1, 2, 3)))
    (remark,) = compare(first, replace(first, **change)).remarks
    assert re.search(says, remark)


@pytest.mark.parametrize("other", [{"who_am_i": 0x70}, {"accel_offsets": (100, 200, 300)}])
def test_a_merge_is_advised_only_for_calibrations_of_one_sensor(other):
    first = replace(TRUTH, sensor=Sensor(who_am_i=0x68, temperature_c=20.0, accel_offsets=(1, 2, 3)))
    later = replace(first, sensor=replace(first.sensor, temperature_c=40.0, **other))
    remarks = " ".join(compare(first, later).remarks)
    assert "B at 40.0 °C" in remarks
    assert "mpucal merge" not in remarks


def test_halves_of_a_real_recording_agree_and_two_real_sensors_differ(shared):
    recording, other = map(mpucal.load, shared("recordings/mpu9150_a.npz", "recordings/mpu9150_b.npz"))
    first, second, of_other = (mpucal.calibrate(part, gravity=9.81) for part in (*halves(recording), other))
    found = compare(first, second)
    assert not found.changed
    assert found.same or not first.verdict == second.verdict == "good"
    # the deviations are not simply large: 15 mg on an axis would be found
    moved = replace(second, b_a=second.b_a + np.array([0.0, 0.0, 0.147]))
    assert compare(first, moved).same is False
    assert compare(second, of_other).same is False


@settings(max_examples=30)
@given(scale=st.floats(-0.05, 0.05), bias=st.floats(-0.5, 0.5), axis=st.integers(0, 2))
def test_the_worst_magnitude_error_is_that_over_attitudes(scale, bias, axis):
    D, b_a = np.eye(3), np.zeros(3)
    D[axis, axis] += scale
    b_a[axis] = bias
    true = replace(TRUTH, D=D, b_a=b_a, fit={"gravity": 9.8})
    points = np.vstack([np.eye(3), -np.eye(3), np.random.default_rng(0).normal(size=(4000, 3))])
    f = 9.8 * points / np.linalg.norm(points, axis=1, keepdims=True)
    worst = np.abs(np.linalg.norm(f @ D.T + b_a, axis=1) - 9.8).max()
    assert worst <= worst_magnitude_error(true, np.eye(3), np.zeros(3)) + 1e-9
    # with both errors along one axis the bound is reached
    assert worst == pytest.approx(9.8 * abs(scale) + abs(bias), abs=0.02)


def test_an_equal_one_is_not_better_and_neither_is_chance():
    assert is_better(0.01, 0.05, 0.01)
    assert not is_better(0.05, 0.05, 0.0)
    assert not is_better(0.0, 0.014, 0.01)


def test_a_change_of_temperature_is_weighed_by_the_chip_of_the_sensor():
    cold = replace(TRUTH, sensor=Sensor("MPU-6500", who_am_i=0x70, temperature_c=20.0))
    (remark,) = compare(cold, replace(cold, sensor=replace(cold.sensor, temperature_c=40.0))).remarks
    assert "the bias of an MPU-6500 changes by about 1 mg per degree" in remark
