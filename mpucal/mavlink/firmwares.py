"""ArduPilot and PX4, the IMU messages of each that a calibration takes, and a vehicle as its HEARTBEAT describes it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from .dialect import Message, dialect
from .imu import DATAFLASH, HIGHRES, RAW, SCALED

ARDUPILOT, PX4 = "ArduPilot", "PX4"

# Bit 0 has the estimator learn the gyroscope's bias, bit 1 the accelerometer's.
EKF2_IMU_CTRL = "EKF2_IMU_CTRL"
LEARN_GYROSCOPE, LEARN_ACCELEROMETER = 0b01, 0b10

# Cut-off frequencies [Hz] of ArduPilot's low passes of the second order (LowPassFilter2p), 0: none. PX4's streams are
# those of vehicle_imu, before its filters.
FILTERS = ("INS_ACCEL_FILTER", "INS_GYRO_FILTER")
# Firmwares take whole Hz.
LEAST_HZ = 1.0


def preferred_messages(firmware: str, parameters: Mapping[str, float]) -> tuple[str, ...]:
    """Return the names of the messages to calibrate from, those nearest to the sensor first.

    PX4's HIGHRES_IMU has the estimator's biases of both sensors subtracted, which follow the very errors that are
    sought, unless EKF2_IMU_CTRL's bits 0 and 1 are clear; and PX4 sends no RAW_IMU.
    """
    if firmware != PX4:
        return (DATAFLASH, HIGHRES, RAW, *SCALED)
    control = parameters.get(EKF2_IMU_CTRL)
    unbiased = control is not None and not int(control) & (LEARN_GYROSCOPE | LEARN_ACCELEROMETER)
    return (HIGHRES, *SCALED) if unbiased else tuple(SCALED)


def accel_lag_s(parameters: Mapping[str, float]) -> float:
    """Return how much more an autopilot's low passes delay its accelerometers than its gyroscopes; 0 if unknown.

    A Butterworth filter of order 2 delays slow signals by sqrt(2) / (2 pi f).
    """
    cutoffs = [parameters.get(name) for name in FILTERS]
    delays = [math.sqrt(2.0) / (2.0 * math.pi * f) if f >= LEAST_HZ else 0.0 for f in cutoffs if f is not None]
    return delays[0] - delays[1] if len(delays) == len(FILTERS) else 0.0


class Vehicle(NamedTuple):
    """Sender of an autopilot's HEARTBEAT.

    Attributes
    ----------
    address : of its packets. system, component : MAVLink ids. autopilot : MAV_AUTOPILOT. type : MAV_TYPE.
    """

    address: str
    system: int
    component: int
    autopilot: int
    type: int

    @property
    def family(self) -> str:
        """PX4 or ARDUPILOT: the firmware whose parameters, streams and checks this vehicle has."""
        return PX4 if self.autopilot == dialect().MAV_AUTOPILOT_PX4 else ARDUPILOT

    @property
    def firmware(self) -> str:
        """The autopilot's name, or its number where it is neither ArduPilot nor PX4."""
        known = (dialect().MAV_AUTOPILOT_PX4, dialect().MAV_AUTOPILOT_ARDUPILOTMEGA)
        return self.family if self.autopilot in known else f"autopilot {self.autopilot}"

    def __str__(self) -> str:
        return f"system {self.system} ({self.firmware}) at {self.address}"


def vehicle_of(address: str, message: Message) -> Vehicle | None:
    """Return the sender of a message from `address` if the message is an autopilot's HEARTBEAT."""
    m = dialect()
    if message.get_type() != "HEARTBEAT" or message.autopilot == m.MAV_AUTOPILOT_INVALID:
        return None
    if message.type == m.MAV_TYPE_GCS:
        return None
    return Vehicle(address, message.get_srcSystem(), message.get_srcComponent(), message.autopilot, message.type)
