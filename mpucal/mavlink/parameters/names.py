"""Which parameters of which firmware correct which IMU, and how it is mounted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...data import Vector
from ..firmwares import PX4
from ..rotation import euler, orientation
from .compose import Correction

Values = Mapping[str, float]

AXES = ("X", "Y", "Z")
PX4_SLOTS, ARDUPILOT_IMUS = 4, 3
# AHRS_ORIENTATION -> the names of its roll, pitch and yaw in degrees; before ArduPilot 4.2 only the first
CUSTOM_ANGLES = {
    100: ("AHRS_CUSTOM_ROLL", "AHRS_CUSTOM_PIT", "AHRS_CUSTOM_YAW"),
    101: ("CUST_ROT1_ROLL", "CUST_ROT1_PITCH", "CUST_ROT1_YAW"),
    102: ("CUST_ROT2_ROLL", "CUST_ROT2_PITCH", "CUST_ROT2_YAW"),
}


@dataclass(frozen=True)
class Limits:
    """What a firmware accepts of its own calibration: |offset| at most [m/s^2], scale from lowest to highest.

    What differs from 0 (scale: from 1) by a norm of `unnoticed` or less, it stores and does not use.
    """

    offset_mps2: float
    lowest: float
    highest: float
    unnoticed: float


# ArduPilot: AccelCalibrator's; PX4: the parameters' own, and sensor_calibration's Accelerometer
ARDUPILOT_LIMITS = Limits(9.8, 0.8, 1.2, 0.0)
PX4_LIMITS = Limits(np.inf, 0.1, 3.0, 0.01)


@dataclass(frozen=True)
class Slot:
    """Where a vehicle keeps one IMU's correction.

    Attributes
    ----------
    imu : counted from 1. offset, scale : three names each, of x, y, z. sensor_id : the name of the sensor's id.
    limits : what the firmware accepts there.
    """

    imu: int
    offset: tuple[str, ...]
    scale: tuple[str, ...]
    sensor_id: str
    limits: Limits

    @property
    def names(self) -> tuple[str, ...]:
        """All six of a correction."""
        return (*self.offset, *self.scale)

    def correction(self, values: Values) -> Correction | None:
        """What is there; None where a value is missing."""
        if not all(name in values for name in self.names):
            return None
        offset, scale = (np.array([values[name] for name in names]) for names in (self.offset, self.scale))
        return Correction(offset, scale)

    def values(self, correction: Correction) -> dict[str, float]:
        """The same by name."""
        return dict(zip(self.names, (*correction.offset.tolist(), *correction.scale.tolist()), strict=True))

    def effective(self, correction: Correction) -> Correction:
        """What the firmware makes of it when it starts."""
        offset, scale = correction.offset, correction.scale
        if np.linalg.norm(offset) <= self.limits.unnoticed:
            offset = np.zeros(3)
        if np.linalg.norm(scale - 1) <= self.limits.unnoticed:
            scale = np.ones(3)
        return Correction(offset, scale)

    def describe_excess(self, correction: Correction) -> str | None:
        """Which value lies beyond what the firmware accepts, in words."""
        limits = self.limits
        for name, value in self.values(correction).items():
            lowest, highest = -limits.offset_mps2, limits.offset_mps2
            if name in self.scale:
                lowest, highest = limits.lowest, limits.highest
            if not lowest <= value <= highest:
                return f"{name} would be {value:.4g}, beyond {lowest:g} to {highest:g}"
        return None


def find_slot(firmware: str, imu: int, values: Values) -> Slot | None:
    """Where IMU `imu` (counted from 1) of a vehicle with these parameters has its correction.

    PX4 keeps it in a slot that names its sensor by id; its streams are in the order of those slots. None where no
    slot does.
    """
    if firmware != PX4:
        return ardupilot_slot(imu)
    slots = [slot for slot in range(PX4_SLOTS) if values.get(f"CAL_ACC{slot}_ID")]
    return px4_slot(imu, slots[imu - 1]) if imu <= len(slots) else None


def ardupilot_slot(imu: int) -> Slot:
    """The place of an IMU of ArduPilot's."""
    stem = "INS_ACC" if imu == 1 else f"INS_ACC{imu}"
    offset, scale = (tuple(f"{stem}{kind}_{axis}" for axis in AXES) for kind in ("OFFS", "SCAL"))
    return Slot(imu, offset, scale, f"{stem}_ID", ARDUPILOT_LIMITS)


def px4_slot(imu: int, slot: int) -> Slot:
    """The place in a slot of PX4's."""
    stem = f"CAL_ACC{slot}_"
    offset, scale = (tuple(f"{stem}{axis}{kind}" for axis in AXES) for kind in ("OFF", "SCALE"))
    return Slot(imu, offset, scale, f"{stem}ID", PX4_LIMITS)


def all_slots(firmware: str) -> tuple[Slot, ...]:
    """Every one that the firmware has."""
    if firmware == PX4:
        return tuple(px4_slot(slot + 1, slot) for slot in range(PX4_SLOTS))
    return tuple(ardupilot_slot(imu) for imu in range(1, ARDUPILOT_IMUS + 1))


def slot_of(firmware: str, imu: int, values: Values) -> Slot | None:
    """The place that `values`, the parameters of one IMU, belong to; None where that is none."""
    found = (where for where in all_slots(firmware) if set(where.names) <= set(values))
    return next((replace(where, imu=imu) for where in found), None)


def mounting(firmware: str, where: Slot, values: Values) -> Vector | None:
    """R_b (3, 3) from the axes of the sensor at `where` to the vehicle's; None where it cannot be known."""
    if firmware != PX4:
        return _rotation("AHRS_ORIENTATION", values, CUSTOM_ANGLES)
    own = where.sensor_id.replace("_ID", "_ROT")
    # -1: inside the autopilot, which the board's rotation turns
    turned = _rotation(own if values.get(own, -1) >= 0 else "SENS_BOARD_ROT", values, {})
    level = np.radians([values.get(f"SENS_BOARD_{axis}_OFF", 0.0) for axis in AXES])
    return None if turned is None else euler(*level.tolist()) @ turned


def _rotation(name: str, values: Values, custom: Mapping[int, tuple[str, ...]]) -> Vector | None:
    if name not in values:
        return None
    number = round(values[name])
    if number in custom:
        if not all(angle in values for angle in custom[number]):
            return None
        return euler(*np.radians([values[angle] for angle in custom[number]]).tolist())
    return orientation(number)
