"""ArduPilot and PX4 by name, and the IMU messages of each that a calibration takes."""

from __future__ import annotations

import math
from collections.abc import Mapping

from .imu import DATAFLASH, HIGHRES, RAW, SCALED

ARDUPILOT, PX4 = "ArduPilot", "PX4"

# Bit 0 has the estimator learn the gyroscope's bias, bit 1 the accelerometer's.
EKF2_IMU_CTRL, BIASES = "EKF2_IMU_CTRL", 0b11

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
    unbiased = control is not None and not int(control) & BIASES
    return (HIGHRES, *SCALED) if unbiased else tuple(SCALED)


def accel_lag_s(parameters: Mapping[str, float]) -> float:
    """Return how much more an autopilot's low passes delay its accelerometers than its gyroscopes; 0 if unknown.

    A Butterworth filter of order 2 delays slow signals by sqrt(2) / (2 pi f).
    """
    cutoffs = [parameters.get(name) for name in FILTERS]
    delays = [math.sqrt(2.0) / (2.0 * math.pi * f) if f >= LEAST_HZ else 0.0 for f in cutoffs if f is not None]
    return delays[0] - delays[1] if len(delays) == len(FILTERS) else 0.0
