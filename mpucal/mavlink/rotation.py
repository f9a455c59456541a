"""Rotation matrices (3, 3): of MAV_SENSOR_ORIENTATION, of roll, pitch and yaw.

scipy.spatial.transform loads where one is made.
"""

from __future__ import annotations

import re

import numpy as np

from ..data import Vector
from .dialect import dialect

CUSTOM = 100
_ANGLE = re.compile(r"(ROLL|PITCH|YAW)_(\d+)")


def euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Vector:
    """R_b (3, 3) that takes the sensor's axes to the vehicle's: R_z(yaw) R_y(pitch) R_x(roll)."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    return np.asarray(Rotation.from_euler("xyz", (roll_rad, pitch_rad, yaw_rad)).as_matrix())


def orientation(number: int) -> Vector | None:
    """R_b (3, 3) of a MAV_SENSOR_ORIENTATION, whose names spell its angles; None for one that has no angles."""
    entry = dialect().enums["MAV_SENSOR_ORIENTATION"].get(number)
    if entry is None or number >= CUSTOM:
        return None
    angles = {axis: float(degrees) for axis, degrees in _ANGLE.findall(entry.name)}
    return euler(*(np.radians(angles.get(axis, 0.0)) for axis in ("ROLL", "PITCH", "YAW")))
