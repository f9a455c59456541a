"""New parameters from a calibration, and the slots that hold those of each IMU in a firmware.

An autopilot delivers y = R_b K (s - o) of its sensor's output s: offset o and scale K = diag(k) in the sensor's axes,
then the board's rotation R_b. The calibration says y = D f + b of the specific force f, so that with

    o' = o + inv(K) R_b^T b,    M = R_b^T inv(D) R_b K

R_b M (s - o') is f itself. An autopilot holds M's diagonal only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector
from ..firmwares import PX4


@dataclass(frozen=True)
class Correction:
    """The correction (s - offset) * scale that an IMU's parameters apply to the output s of its sensor.

    Attributes
    ----------
    offset : (3,) m/s^2, and scale : (3,), in the sensor's axes.
    """

    offset: Vector
    scale: Vector

    def recorrect(self, new: Correction, R_b: Vector, y: Vector) -> Vector:
        """Return the (..., 3) m/s^2 that a stream y under this correction would be under `new`."""
        s = y @ R_b / self.scale + self.offset
        return np.asarray(((s - new.offset) * new.scale) @ R_b.T)

    def is_close(self, other: Correction) -> bool:
        """Return True if they differ by no more than parameters of 32 bits do."""
        return bool(np.allclose([self.offset, self.scale], [other.offset, other.scale], atol=1e-6))


@dataclass(frozen=True)
class Composed:
    """The correction that a calibration asks for, and what it cannot hold.

    Attributes
    ----------
    correction : the new parameters. M : (3, 3), of which they hold the diagonal.
    mounting : R_b (3, 3).
    """

    correction: Correction
    M: Vector
    mounting: Vector

    def residual_of(self, held: Correction) -> float:
        """Return the greatest error of |a| [m/s^2] over all attitudes if the vehicle holds `held`.

        a = R_b diag(scale) (inv(M) R_b^T f + o' - offset): |a| lies between the least and the largest singular value
        of diag(scale) inv(M), times g, and what the offsets differ by. (To first order that is g times the largest
        eigenvalue of the symmetric part of what is off the diagonal.)
        """
        singular = np.linalg.svd(self._deviation(held) + np.eye(3), compute_uv=False)
        shape = STANDARD_GRAVITY_MPS2 * np.abs(singular - 1).max()
        return float(shape + np.linalg.norm(held.scale * (self.correction.offset - held.offset)))

    def residual_rad_of(self, held: Correction) -> float:
        """Return the greatest error of the direction of a [rad] over all attitudes, beside `turn_rad`.

        To first order, the symmetric part S of diag(scale) inv(M) - I moves the unit vector u by S u, of which half the
        difference of S's extreme eigenvalues is the most that is at right angles to u.
        """
        left = self._deviation(held)
        values = np.linalg.eigvalsh((left + left.T) / 2)
        return float(values[-1] - values[0]) / 2

    @property
    def turn_rad(self) -> Vector:
        """Rotation (3,) of the sensor against the gyroscope, in the vehicle's axes, which parameters do not hold.

        Level calibration removes it (AHRS_TRIM). For small angles: the antisymmetric part of diag(scale) inv(M) - I.
        """
        left = self._deviation(self.correction)
        skew = (left - left.T) / 2
        return np.asarray(self.mounting @ np.array([skew[2, 1], skew[0, 2], skew[1, 0]]))

    def _deviation(self, held: Correction) -> Vector:
        """Return diag(scale) inv(M) - I."""
        return np.asarray(np.diag(held.scale) @ np.linalg.inv(self.M) - np.eye(3))


def compose(D: Vector, b_a: Vector, old: Correction, R_b: Vector, gravity: float) -> Composed:
    """Return the parameters that bring the stream nearest to f.

    Parameters
    ----------
    D : (3, 3), b_a : (3,) m/s^2 of the stream as received under `old`.
    R_b : (3, 3) from the sensor's axes to the vehicle's. gravity : m/s^2 that D was fitted with: autopilots calibrate
        to 9.80665 wherever they are.
    """
    offset = old.offset + R_b.T @ b_a / old.scale
    M = R_b.T @ np.linalg.inv(D) @ R_b @ np.diag(old.scale) * (STANDARD_GRAVITY_MPS2 / gravity)
    return Composed(Correction(offset, np.diag(M).copy()), M, R_b)


Values = Mapping[str, float]

AXES = ("X", "Y", "Z")
PX4_SLOTS, ARDUPILOT_IMUS = 4, 3


@dataclass(frozen=True)
class Limits:
    """The range that a firmware accepts of its own calibration.

    Attributes
    ----------
    offset_mps2 : greatest |offset|. lowest, highest : of the scale.
    unnoticed : an offset (scale: its difference from 1) of this norm or less is stored and not used.
    """

    offset_mps2: float
    lowest: float
    highest: float
    unnoticed: float


# ArduPilot: AccelCalibrator's; PX4: the parameters' own, and sensor_calibration's Accelerometer.
ARDUPILOT_LIMITS = Limits(9.8, 0.8, 1.2, 0.0)
PX4_LIMITS = Limits(np.inf, 0.1, 3.0, 0.01)


@dataclass(frozen=True)
class Slot:
    """The parameters of one IMU's accelerometer.

    Attributes
    ----------
    imu : counted from 1. offset, scale : three names each, of x, y, z. sensor_id : name of the sensor's id.
    limits : of the firmware. priority, rotation : names of the sensor's priority and own rotation (PX4).
    gyro_offset : names of the gyroscope's offsets (PX4).
    """

    imu: int
    offset: tuple[str, ...]
    scale: tuple[str, ...]
    sensor_id: str
    limits: Limits
    priority: str | None = None
    rotation: str | None = None
    gyro_offset: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the six parameters of the correction."""
        return (*self.offset, *self.scale)

    def correction(self, values: Values) -> Correction | None:
        """Return the correction in `values`, None if one of the six is missing."""
        if not all(name in values for name in self.names):
            return None
        offset, scale = (np.array([values[name] for name in names]) for names in (self.offset, self.scale))
        return Correction(offset, scale)

    def values(self, correction: Correction) -> dict[str, float]:
        """Return a correction as parameters by name."""
        return dict(zip(self.names, (*correction.offset.tolist(), *correction.scale.tolist()), strict=True))

    def effective(self, correction: Correction) -> Correction:
        """Return the correction that the firmware uses after a start if this one is stored."""
        offset, scale = correction.offset, correction.scale
        if np.linalg.norm(offset) <= self.limits.unnoticed:
            offset = np.zeros(3)
        if np.linalg.norm(scale - 1) <= self.limits.unnoticed:
            scale = np.ones(3)
        return Correction(offset, scale)

    def describe_excess(self, correction: Correction) -> str | None:
        """Return a phrase on the first value beyond the firmware's limits, None if all are within."""
        limits = self.limits
        for name, value in self.values(correction).items():
            lowest, highest = -limits.offset_mps2, limits.offset_mps2
            if name in self.scale:
                lowest, highest = limits.lowest, limits.highest
            if not lowest <= value <= highest:
                return f"{name} would be {value:.4g}, beyond {lowest:g} to {highest:g}"
        return None


def ardupilot_slot(imu: int) -> Slot:
    """Return the slot of an ArduPilot's IMU, counted from 1."""
    stem = "INS_ACC" if imu == 1 else f"INS_ACC{imu}"
    offset, scale = (tuple(f"{stem}{kind}_{axis}" for axis in AXES) for kind in ("OFFS", "SCAL"))
    return Slot(imu, offset, scale, f"{stem}_ID", ARDUPILOT_LIMITS)


def px4_slot(imu: int, number: int) -> Slot:
    """Return PX4's slot of that number for an IMU, counted from 1."""
    stem = f"CAL_ACC{number}_"
    offset, scale = (tuple(f"{stem}{axis}{kind}" for axis in AXES) for kind in ("OFF", "SCALE"))
    gyro_offset = tuple(f"CAL_GYRO{number}_{axis}OFF" for axis in AXES)
    return Slot(imu, offset, scale, f"{stem}ID", PX4_LIMITS, f"{stem}PRIO", f"{stem}ROT", gyro_offset)


def all_slots(firmware: str) -> tuple[Slot, ...]:
    """Return all slots that the firmware has, as those of IMU 1, 2 and so on."""
    if firmware == PX4:
        return tuple(px4_slot(number + 1, number) for number in range(PX4_SLOTS))
    return tuple(ardupilot_slot(imu) for imu in range(1, ARDUPILOT_IMUS + 1))


def find_slot(firmware: str, imu: int, values: Values) -> Slot | None:
    """Return the slot of IMU `imu` (counted from 1) of a vehicle with these parameters.

    A slot of PX4 names its sensor by id; the streams are in the order of the slots that name one. None if no slot
    names that IMU's.
    """
    if firmware != PX4:
        return ardupilot_slot(imu)
    named = [number for number in range(PX4_SLOTS) if values.get(f"CAL_ACC{number}_ID")]
    return px4_slot(imu, named[imu - 1]) if imu <= len(named) else None


def slot_of(firmware: str, imu: int, values: Values) -> Slot | None:
    """Return the slot whose six parameters are in `values`, as that of IMU `imu`; None if there is none."""
    held = (slot for slot in all_slots(firmware) if set(slot.names) <= set(values))
    return next((replace(slot, imu=imu) for slot in held), None)
