"""Mounting of a sensor and level of a vehicle, by its parameters.

R_b (3, 3) is the rotation from a sensor's axes to the vehicle's. A trim is the roll, pitch and yaw [deg] by which the
autopilot is turned in its vehicle, so that a vehicle that stands as it should hover has an attitude of zero roll and
pitch. ArduPilot subtracts it from its attitude, and its streams stay in the autopilot's axes. PX4 turns the streams by
it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ...calibration.rotation import rotation
from ...data import STANDARD_GRAVITY_MPS2, Vector
from ..dialect import dialect
from ..firmwares import PX4
from .slots import AXES, Correction, Slot, Values

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
    x, y, z = rotation(np.diag(np.radians(degrees)))
    return np.asarray(z @ y @ x)


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


# Greatest trim that ArduPilot accepts of its own level calibration (HAL_INS_TRIM_LIMIT_DEG).
MOST_DEG = 10.0
# A smaller one is not measured: PX4's simulator writes 1e-6 so that no level calibration is asked for.
LEAST_DEG = 1e-3


def trim_names(firmware: str) -> tuple[str, ...]:
    """Return the names of the three parameters that hold the trim."""
    return BOARD_ANGLES if firmware == PX4 else tuple(f"AHRS_TRIM_{axis}" for axis in AXES)


def trim_of(firmware: str, values: Values) -> Vector:
    """Return the trim (3,) [deg] in a vehicle's parameters."""
    held = np.array([values[name] for name in trim_names(firmware)])
    return held if firmware == PX4 else np.degrees(held)


def trim_values(firmware: str, trim_deg: Vector) -> dict[str, float]:
    """Return a trim as parameters by name."""
    angles = trim_deg if firmware == PX4 else np.radians(trim_deg)
    return dict(zip(trim_names(firmware), angles.tolist(), strict=True))


def tilt_deg(force: Vector) -> Vector:
    """Return roll and pitch (2,) [deg] at rest, by the specific force (3,) in axes with x forward and z down."""
    x, y, z = force
    return np.degrees([np.arctan2(-y, -z), np.arctan2(x, np.hypot(y, z))])


def stream_axes(firmware: str, trim_deg: Vector) -> Vector:
    """Return the rotation (3, 3) from the autopilot's axes to those of its streams: a PX4 turns them by its trim."""
    return euler_matrix(trim_deg.tolist()) if firmware == PX4 else np.eye(3)


def attitude_deg(firmware: str, trim_deg: Vector, mean: Vector) -> Vector:
    """Return roll and pitch (2,) [deg] that an unbiased estimator has at rest, where a stream's mean is `mean`."""
    return tilt_deg(mean) if firmware == PX4 else tilt_deg(mean) - trim_deg[:2]


@dataclass(frozen=True)
class Level:
    """Change of a vehicle's trim that goes with a change of its first accelerometer's correction.

    Attributes
    ----------
    held_deg, wanted_deg : (3,) before and after.
    """

    firmware: str
    held_deg: Vector
    wanted_deg: Vector

    @property
    def turn(self) -> Vector:
        """Rotation (3, 3) of the streams by the change."""
        return stream_axes(self.firmware, self.wanted_deg) @ stream_axes(self.firmware, self.held_deg).T

    def values(self) -> dict[str, float]:
        """Return the new trim as parameters by name."""
        return trim_values(self.firmware, self.wanted_deg)


@dataclass(frozen=True)
class Leveller:
    """Choice of the new trim of a vehicle.

    Attributes
    ----------
    held_deg : (3,) its trim. old, new : its first accelerometer's correction before and after; None: it stays.
    mounting : R_b (3, 3) under the old trim.
    """

    firmware: str
    held_deg: Vector
    old: Correction | None
    new: Correction | None
    mounting: Vector

    def keep(self) -> Level:
        """Return the level by which what was level stays level; a trim of zero, which nobody levelled, stays.

        Under `old`, the specific force along u was level, and `new` makes A t u + c of t u. Its length is g, which
        gives t.
        """
        if np.abs(self.held_deg[:2]).max() < LEAST_DEG:
            return self._level(self.held_deg[:2])
        u = euler_matrix(self.held_deg.tolist()).T @ [0.0, 0.0, -1.0]
        c = self._recorrect(np.zeros(3))
        Au = self._recorrect(u) - c
        t = np.roots([Au @ Au, 2 * Au @ c, c @ c - STANDARD_GRAVITY_MPS2**2]).max()
        return self._level(tilt_deg(Au * t + c))

    def measure(self, mean: Vector) -> Level | None:
        """Return the level of a vehicle that stands level, by its first stream's mean; None if it is too tilted."""
        wanted = self._level(tilt_deg(self._recorrect(self._axes.T @ mean)))
        return wanted if np.abs(wanted.wanted_deg[:2]).max() <= MOST_DEG else None

    def standing_deg(self, level: Level, mean: Vector) -> Vector:
        """Return roll and pitch (2,) [deg] under `level` of a vehicle whose first stream's mean was `mean`."""
        force = self._recorrect(self._axes.T @ mean)
        axes = stream_axes(self.firmware, level.wanted_deg)
        return attitude_deg(self.firmware, level.wanted_deg, axes @ force)

    @property
    def _axes(self) -> Vector:
        return stream_axes(self.firmware, self.held_deg)

    def _recorrect(self, force: Vector) -> Vector:
        """Return what `force`, in the autopilot's axes and under the old correction, is under the new one."""
        if self.old is None or self.new is None:
            return force
        return self.old.recorrect(self.new, self._axes.T @ self.mounting, force)

    def _level(self, roll_pitch_deg: Vector) -> Level:
        return Level(self.firmware, self.held_deg, np.append(roll_pitch_deg, self.held_deg[2]))
