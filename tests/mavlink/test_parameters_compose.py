"""New parameters of a calibration, judged by the stream that they then make, computed the long way."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.data import STANDARD_GRAVITY_MPS2
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.parameters.compose import Correction, compose
from mpucal.mavlink.parameters.mounting import orientation_matrix
from mpucal.mavlink.parameters.slots import px4_slot
from mpucal.mavlink.segments import find_recorrection

ORIENTATIONS = [number for number in range(41) if orientation_matrix(number) is not None]


def sensor(rng, cross):
    """Return C and bias of raw = C f_sensor + bias, in the sensor's axes."""
    C = np.diag(rng.uniform(0.9, 1.1, 3)) + cross * rng.uniform(-1, 1, (3, 3)) * (1 - np.eye(3))
    return C, rng.uniform(-1, 1, 3)


def stream(C, bias, correction, R, f):
    """Return an autopilot's output for the specific force f (n, 3) in its own axes."""
    raw = f @ R @ C.T + bias
    return ((raw - correction.offset) * correction.scale) @ R.T


def calibrated(C, bias, correction, R):
    """Return D and b_a of that stream."""
    b = stream(C, bias, correction, R, np.zeros((1, 3)))[0]
    return (stream(C, bias, correction, R, np.eye(3)) - b).T, b


def composed_at_random(seed, number, cross):
    rng = np.random.default_rng(seed)
    R = orientation_matrix(number)
    C, bias = sensor(rng, cross)
    old = Correction(rng.uniform(-0.5, 0.5, 3), rng.uniform(0.9, 1.1, 3))
    return C, bias, R, compose(*calibrated(C, bias, old, R), old, R, STANDARD_GRAVITY_MPS2)


def sphere(n, radius):
    points = np.random.default_rng(0).normal(size=(n, 3))
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from(ORIENTATIONS))
def test_a_sensor_without_cross_axis_terms_is_made_perfect(seed, number):
    C, bias, R, composed = composed_at_random(seed, number, cross=0.0)
    f = sphere(20, STANDARD_GRAVITY_MPS2)
    np.testing.assert_allclose(stream(C, bias, composed.correction, R, f), f, atol=1e-9)
    assert composed.residual_of(composed.correction) < 1e-9


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from(ORIENTATIONS))
def test_the_direction_that_is_left_is_that_of_the_worst_attitude(seed, number):
    C, bias, R, composed = composed_at_random(seed, number, cross=0.003)
    f = sphere(3000, STANDARD_GRAVITY_MPS2)
    a = stream(C, bias, composed.correction, R, f) - np.cross(composed.turn_rad, f)
    angles = np.linalg.norm(np.cross(f, a), axis=1) / STANDARD_GRAVITY_MPS2**2
    assert angles.max() == pytest.approx(composed.residual_rad_of(composed.correction), rel=0.03, abs=5e-5)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from(ORIENTATIONS))
def test_the_offset_is_exact_and_the_residual_that_of_the_worst_attitude(seed, number):
    C, bias, R, composed = composed_at_random(seed, number, cross=0.02)
    new = composed.correction
    np.testing.assert_allclose(new.offset, bias, atol=1e-12)
    f = sphere(4000, STANDARD_GRAVITY_MPS2)
    worst = np.abs(np.linalg.norm(stream(C, bias, new, R, f), axis=1) - STANDARD_GRAVITY_MPS2).max()
    assert composed.residual_of(new) == pytest.approx(worst, rel=0.03, abs=1e-4)


def test_an_autopilot_is_calibrated_to_standard_gravity_wherever_it_is():
    C, bias = np.diag([1.02, 0.98, 1.01]), np.array([0.1, -0.2, 0.3])
    old, R, local = Correction(np.zeros(3), np.ones(3)), np.eye(3), 9.78
    # a fit that takes local gravity for `local` sees C in these units
    composed = compose(*calibrated(C, bias, old, R), old, R, local)
    a = stream(C, bias, composed.correction, R, sphere(50, local))
    np.testing.assert_allclose(np.linalg.norm(a, axis=1), STANDARD_GRAVITY_MPS2, rtol=1e-12)


def test_a_pure_rotation_is_reported_and_not_written():
    angle = np.radians(2.0)
    D = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    composed = compose(D, np.zeros(3), Correction(np.zeros(3), np.ones(3)), np.eye(3), STANDARD_GRAVITY_MPS2)
    np.testing.assert_allclose(np.degrees(composed.turn_rad), [0, 0, 2.0], atol=0.01)
    assert composed.residual_of(composed.correction) < 0.01


def test_the_stream_after_a_change_is_predicted():
    rng = np.random.default_rng(5)
    C, bias = sensor(rng, cross=0.02)
    R = orientation_matrix(14)
    old, new = (Correction(rng.uniform(-0.5, 0.5, 3), rng.uniform(0.9, 1.1, 3)) for _ in range(2))
    f = sphere(10, STANDARD_GRAVITY_MPS2)
    predicted = old.recorrect(new, R, stream(C, bias, old, R, f))
    np.testing.assert_allclose(predicted, stream(C, bias, new, R, f), atol=1e-12)


def test_orientations_are_pymavlinks_euler_angles():
    rotmat = pytest.importorskip("pymavlink.rotmat")
    for number in ORIENTATIONS:
        words = dialect().enums["MAV_SENSOR_ORIENTATION"][number].name.removeprefix("MAV_SENSOR_ROTATION_").split("_")
        angles = dict(zip(words[::2], map(float, words[1::2]), strict=False)) if len(words) > 1 else {}
        expected = rotmat.Matrix3()
        expected.from_euler(*(np.radians(angles.get(axis, 0.0)) for axis in ("ROLL", "PITCH", "YAW")))
        rows = [[v.x, v.y, v.z] for v in (expected.a, expected.b, expected.c)]
        np.testing.assert_allclose(orientation_matrix(number), rows, atol=1e-12, err_msg=words)


def test_an_orientation_without_angles_is_unknown():
    assert orientation_matrix(100) is None
    assert orientation_matrix(77) is None


def test_a_sensor_that_px4_names_later_than_the_next_one_keeps_its_own_correction():
    unnamed = {"SENS_BOARD_ROT": 0.0} | {
        name: float(name.endswith("SCALE")) for slot in range(4) for name in px4_slot(slot + 1, slot).names
    }
    unnamed |= {f"CAL_ACC{slot}_ID": 0.0 for slot in range(4)}
    second = unnamed | {"CAL_ACC1_ID": 7.0, "CAL_ACC1_XOFF": 0.4}
    both = second | {"CAL_ACC0_ID": 5.0, "CAL_ACC0_YOFF": 0.3}
    for now, moved in ((unnamed, -0.3), (second, -0.3), (both, 0.0)):
        assert find_recorrection("PX4", 1, now, both).acc(np.zeros(3)) == pytest.approx([0.0, moved, 0.0])
    assert find_recorrection("PX4", 2, unnamed, both).acc(np.zeros(3)) == pytest.approx([-0.4, 0.0, 0.0])
    assert find_recorrection("PX4", 1, both, both | {"CAL_ACC0_ID": 9.0}) is None
