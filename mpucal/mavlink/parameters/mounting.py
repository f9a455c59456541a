"""Mounting of a sensor: the rotation matrix R_b (3, 3) from its axes to the vehicle's, by the vehicle's parameters.

scipy.spatial.transform is imported when a matrix is made.
"""

from __future__ import annotations

import re

import numpy as np

from ...data import Vector
from ..dialect import dialect
from ..firmwares import PX4
from .slots import AXES, Slot, Values

ORIENTATION, BOARD_ROTATION = "AHRS_ORIENTATION", "SENS_BOARD_ROT"
BOARD_ANGLES = tuple(f"SENS_BOARD_{axis}_OFF" for axis in AXES)
# AHRS_ORIENTATION -> the names of its roll, pitch and yaw in degrees; before ArduPilot 4.2 only the first.
CUSTOM_ANGLES = {
    100: ("AHRS_CUSTOM_ROLL", "AHRS_CUSTOM_PIT", "AHRS_CUSTOM_YAW"),
    101: ("CUST_ROT1_ROLL", "CUST_ROT1_PITCH", "CUST_ROT1_YAW"),
    102: ("CUST_ROT2_ROLL", "CUST_ROT2_PITCH", "CUST_ROT2_YAW"),
}
_ANGLE = re.compile(r"(ROLL|PITCH|YAW)_(\d+)")


def mounting(firmware: str, slot: Slot, values: Values) -> Vector | None:
    """Return R_b of the sensor in `slot`, None if the parameters do not say it."""
    if firmware != PX4:
        return _rotation(ORIENTATION, values)
    # A rotation of -1 is that of a sensor inside the autopilot, which is turned with the board.
    own = str(slot.rotation)
    turned = _rotation(own if values.get(own, -1) >= 0 else BOARD_ROTATION, values)
    level_deg = [values.get(name, 0.0) for name in BOARD_ANGLES]
    return None if turned is None else euler_matrix(level_deg) @ turned


def euler_matrix(degrees: tuple[float, ...] | list[float]) -> Vector:
    """Return R_b = R_z(yaw) R_y(pitch) R_x(roll) of roll, pitch and yaw."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    return np.asarray(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix())


def orientation_matrix(number: int) -> Vector | None:
    """Return R_b of a MAV_SENSOR_ORIENTATION, whose names spell its angles; None for one that has no angles."""
    entry = dialect().enums["MAV_SENSOR_ORIENTATION"].get(number)
    if entry is None or number >= min(CUSTOM_ANGLES):
        return None
    angles = {axis: float(degrees) for axis, degrees in _ANGLE.findall(entry.name)}
    return euler_matrix([angles.get(axis, 0.0) for axis in ("ROLL", "PITCH", "YAW")])


def _rotation(name: str, values: Values) -> Vector | None:
    if name not in values:
        return None
    number = round(values[name])
    angles = CUSTOM_ANGLES.get(number, ()) if name == ORIENTATION else ()
    if not angles:
        return orientation_matrix(number)
    return euler_matrix([values[angle] for angle in angles]) if set(angles) <= set(values) else None
