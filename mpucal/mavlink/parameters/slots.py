"""Slots: the parameters of a firmware in which the correction of one IMU's accelerometer is stored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..firmwares import PX4
from .compose import Correction

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
