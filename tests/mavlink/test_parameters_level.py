"""A vehicle's level: what was level under the old parameters is level under the new ones, in any mounting."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.mavlink.parameters.compose import Correction
from mpucal.mavlink.parameters.level import Leveller, tilt_deg, trim_of, trim_values

SMALL = st.floats(-8, 8)
OFFSETS = st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array)
SCALES = st.tuples(*[st.floats(0.95, 1.05)] * 3).map(np.array)
FIRMWARES = ("ArduPilot", "PX4")


def turn(degrees):
    """Return Rz(yaw) Ry(pitch) Rx(roll) by plain trigonometry, as autopilots multiply it."""
    (a, b, c), (d, e, f) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    x = np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
    y = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
    z = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    return z @ y @ x


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_trim_is_the_one_in_the_parameters(firmware):
    trim_deg = np.array([1.0, -2.0, 0.5])
    values = trim_values(firmware, trim_deg)
    np.testing.assert_allclose(trim_of(firmware, values), trim_deg)
    assert max(map(abs, values.values())) == pytest.approx(2.0 if firmware == "PX4" else np.radians(2))


@given(
    firmware=st.sampled_from(FIRMWARES),
    trim=st.tuples(SMALL, SMALL, SMALL).filter(lambda t: any(t[:2])).map(np.array),
    board=st.integers(0, 3),
    offsets=st.tuples(OFFSETS, OFFSETS),
    scales=st.tuples(SCALES, SCALES),
    heading=st.floats(0, 6),
)
def test_what_was_level_stays_level(firmware, trim, board, offsets, scales, heading):
    R_0 = Rotation.from_euler("z", 45 * board, degrees=True).as_matrix()
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


def test_a_vehicle_on_a_slope_is_not_levelled_to_it():
    same = Correction(np.zeros(3), np.ones(3))
    leveller = Leveller("ArduPilot", np.zeros(3), same, same, np.eye(3))
    assert leveller.measure(turn([0, 11, 0]).T @ [0, 0, -G]) is None
    measured = leveller.measure(turn([0, 9, 0]).T @ [0, 0, -G])
    np.testing.assert_allclose(measured.wanted_deg, [0, 9, 0], atol=1e-9)
