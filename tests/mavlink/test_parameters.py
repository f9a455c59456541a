"""New parameters and levels, judged by the stream that they then make, computed the long way."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.data import Autopilot
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.parameters.document import autopilot_document
from mpucal.mavlink.parameters.mounting import Leveller, mounting, orientation_matrix, tilt_deg
from mpucal.mavlink.parameters.plan import Change
from mpucal.mavlink.parameters.slots import Correction, ardupilot_slot, compose, find_slot, px4_slot
from mpucal.mavlink.segments import find_recorrection
from mpucal.result.calibration import Calibration

ORIENTATIONS = [number for number in range(41) if orientation_matrix(number) is not None]
SAME = Correction(np.zeros(3), np.ones(3))


def stream(C, bias, correction, R, f):
    """Return an autopilot's output for the specific force f (n, 3) in its own axes; the sensor's is C f + bias."""
    raw = f @ R @ C.T + bias
    return ((raw - correction.offset) * correction.scale) @ R.T


def composed(C, bias, old, R, gravity=G):
    """Return what `compose` makes of the calibration of that stream."""
    b = stream(C, bias, old, R, np.zeros((1, 3)))[0]
    return compose((stream(C, bias, old, R, np.eye(3)) - b).T, b, old, R, gravity)


def sphere(n, radius):
    points = np.random.default_rng(0).normal(size=(n, 3))
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from(ORIENTATIONS), st.sampled_from([0.0, 0.003]))
def test_offsets_are_exact_and_the_residuals_those_of_the_worst_attitude(seed, number, cross):
    rng = np.random.default_rng(seed)
    R, f = orientation_matrix(number), sphere(3000, G)
    C = np.diag(rng.uniform(0.9, 1.1, 3)) + cross * rng.uniform(-1, 1, (3, 3)) * (1 - np.eye(3))
    bias, old = rng.uniform(-1, 1, 3), Correction(rng.uniform(-0.5, 0.5, 3), rng.uniform(0.9, 1.1, 3))
    made = composed(C, bias, old, R)
    new = made.correction
    np.testing.assert_allclose(new.offset, bias, atol=1e-12)
    after = stream(C, bias, new, R, f)
    worst = np.abs(np.linalg.norm(after, axis=1) - G).max()
    assert made.residual_of(new) == pytest.approx(worst, rel=0.03, abs=1e-4 if cross else 1e-9)
    angles = np.linalg.norm(np.cross(f, after - np.cross(made.turn_rad, f)), axis=1) / G**2
    assert angles.max() == pytest.approx(made.residual_rad_of(new), rel=0.03, abs=5e-5 if cross else 1e-9)
    # and the stream after a change is predicted
    np.testing.assert_allclose(old.recorrect(new, R, stream(C, bias, old, R, f)), after, atol=1e-9)


def test_an_autopilot_is_calibrated_to_standard_gravity_at_any_place():
    C, bias, local = np.diag([1.02, 0.98, 1.01]), np.array([0.1, -0.2, 0.3]), 9.78
    # a fit that takes local gravity for `local` sees C in these units
    new = composed(C, bias, SAME, np.eye(3), local).correction
    a = stream(C, bias, new, np.eye(3), sphere(50, local))
    np.testing.assert_allclose(np.linalg.norm(a, axis=1), G, rtol=1e-12)


def test_orientations_are_pymavlinks_euler_angles():
    rotmat = pytest.importorskip("pymavlink.rotmat")
    for number in ORIENTATIONS:
        words = dialect().enums["MAV_SENSOR_ORIENTATION"][number].name.removeprefix("MAV_SENSOR_ROTATION_").split("_")
        angles = dict(zip(words[::2], map(float, words[1::2]), strict=False)) if len(words) > 1 else {}
        expected = rotmat.Matrix3()
        expected.from_euler(*(np.radians(angles.get(axis, 0.0)) for axis in ("ROLL", "PITCH", "YAW")))
        rows = [[v.x, v.y, v.z] for v in (expected.a, expected.b, expected.c)]
        np.testing.assert_allclose(orientation_matrix(number), rows, atol=1e-12, err_msg=words)
    assert orientation_matrix(100) is orientation_matrix(77) is None


def test_the_mounting_is_that_of_the_board_unless_the_sensor_is_outside():
    slot = find_slot("PX4", 1, {"CAL_ACC0_ID": 5.0})
    board = {"SENS_BOARD_ROT": 2.0, "CAL_ACC0_ROT": -1.0}
    outside = board | {"CAL_ACC0_ROT": 4.0}
    level = board | {"SENS_BOARD_ROT": 0.0, "SENS_BOARD_Z_OFF": 90.0}
    for values, x in ((board, [0, 1, 0]), (outside, [-1, 0, 0]), (level, [0, 1, 0])):
        np.testing.assert_allclose(mounting("PX4", slot, values) @ [1, 0, 0], x, atol=1e-12)


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


@pytest.mark.parametrize(
    ("lacking", "why"), [("AHRS_ORIENTATION", "board rotation"), ("INS_ACCSCAL_Y", "INS_ACCOFFS_X")]
)
def test_missing_parameters_leave_no_new_ones(lacking, why):
    names = ["AHRS_ORIENTATION", *(f"INS_ACC{kind}_{axis}" for kind in ("OFFS", "SCAL") for axis in "XYZ")]
    fitted = Calibration(np.eye(3), np.zeros(3), fit={"gravity": G}, quality={"verdict": "good", "reasons": []})
    parameters = {name: 1.0 for name in names if name != lacking}
    document = autopilot_document(Autopilot("ArduPilot", 1, "SCALED_IMU", parameters), fitted)
    assert document["params_new"] == {}
    assert why in document["why"]


SMALL = st.floats(-8, 8)
OFFSETS = st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array)
SCALES = st.tuples(*[st.floats(0.95, 1.05)] * 3).map(np.array)


def turn(degrees):
    """Return Rz(yaw) Ry(pitch) Rx(roll), as autopilots multiply it."""
    return Rotation.from_euler("ZYX", np.flip(degrees), degrees=True).as_matrix()


@given(
    firmware=st.sampled_from(["ArduPilot", "PX4"]),
    trim=st.tuples(SMALL, SMALL, SMALL).filter(lambda t: max(map(abs, t[:2])) > 1e-3).map(np.array),
    board=st.integers(0, 3),
    offsets=st.tuples(OFFSETS, OFFSETS),
    scales=st.tuples(SCALES, SCALES),
)
def test_a_level_vehicle_stays_level(firmware, trim, board, offsets, scales):
    R_0 = turn([0, 0, 45 * board])
    old, new = (Correction(*pair) for pair in zip(offsets, scales, strict=True))
    R_old = turn(trim) if firmware == "PX4" else np.eye(3)
    level = Leveller(firmware, trim, old, new, R_old @ R_0).keep()
    # a rest that the old parameters and trim call level, which the new parameters give the length g
    direction = turn(trim).T @ [0, 0, -1]
    sensor = np.linspace(8, 12, 4001)[:, None] * (R_0.T @ direction) / old.scale + old.offset
    corrected = ((sensor - new.offset) * new.scale) @ R_0.T
    nearest = corrected[np.abs(np.linalg.norm(corrected, axis=1) - G).argmin()]
    np.testing.assert_allclose(tilt_deg(turn(level.wanted_deg) @ nearest), 0, atol=0.01)
    assert level.wanted_deg[2] == trim[2]


@pytest.mark.parametrize("trim", [0.0, 1e-6])
def test_an_unmeasured_trim_stays(trim):
    biased = Correction(np.array([0.3, 0.0, 0.0]), np.ones(3))
    held = np.array([trim, 0.0, 0.0])
    np.testing.assert_array_equal(Leveller("PX4", held, SAME, biased, np.eye(3)).keep().wanted_deg, held)


def test_a_vehicle_on_a_slope_is_not_levelled_to_it():
    leveller = Leveller("ArduPilot", np.zeros(3), SAME, SAME, np.eye(3))
    assert leveller.measure(turn([0, 11, 0]).T @ [0, 0, -G]) is None
    measured = leveller.measure(turn([0, 9, 0]).T @ [0, 0, -G])
    np.testing.assert_allclose(measured.wanted_deg, [0, 9, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("slot", "scale", "says"),
    [(ardupilot_slot(1), 1.005, ""), (px4_slot(1, 0), 1.05, ""), (px4_slot(0, 1), 1.005, "a scale so near to 1")],
)
def test_a_change_says_what_the_firmware_does_not_use(slot, scale, says):
    new = Correction(np.full(3, 0.1), np.array([scale, 1.0, 1.0]))
    change = Change(slot, SAME, new, np.eye(3), None, None, 0.05)
    assert change.residual == "0.050 m/s^2 in |a|" + (f" (the firmware does not use {says})" if says else "")
