"""How an autopilot is mounted: MAV_SENSOR_ORIENTATION as a rotation matrix. Knows no parameter's name."""

from __future__ import annotations

import re

import numpy as np

from ...data import Vector
from ..dialect import dialect

CUSTOM = 100
_ANGLE = re.compile(r"(ROLL|PITCH|YAW)_(\d+)")


def euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Vector:
    """R_b (3, 3) that takes the sensor's axes to the vehicle's: R_z(yaw) R_y(pitch) R_x(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos((roll_rad, pitch_rad, yaw_rad)), np.sin((roll_rad, pitch_rad, yaw_rad))
    Rx = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    Ry = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    Rz = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(Rz @ Ry @ Rx)


def orientation(number: int) -> Vector | None:
    """R_b (3, 3) of a MAV_SENSOR_ORIENTATION, whose names spell its angles; None for one that has no angles."""
    entry = dialect().enums["MAV_SENSOR_ORIENTATION"].get(number)
    if entry is None or number >= CUSTOM:
        return None
    angles = {axis: float(degrees) for axis, degrees in _ANGLE.findall(entry.name)}
    return euler(*(np.radians(angles.get(axis, 0.0)) for axis in ("ROLL", "PITCH", "YAW")))
