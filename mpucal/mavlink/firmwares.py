"""ArduPilot and PX4 by name, and which of their IMU messages a calibration takes."""

from __future__ import annotations

import math
from collections.abc import Mapping

from .imu import DATAFLASH, HIGHRES, RAW

ARDUPILOT, PX4 = "ArduPilot", "PX4"

# of which bit 0 has the estimator learn the gyroscope's bias, bit 1 the accelerometer's
EKF2_IMU_CTRL, BIASES = "EKF2_IMU_CTRL", 0b11

# cut-off frequencies [Hz] of ArduPilot's low passes of the second order (LowPassFilter2p), 0: none. PX4's streams are
# those of vehicle_imu, which its filters follow.
FILTERS = ("INS_ACCEL_FILTER", "INS_GYRO_FILTER")

SCALED_ORDER = ("SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3")


def preferred_messages(firmware: str, parameters: Mapping[str, float]) -> tuple[str, ...]:
    """Names of the messages to calibrate from, those nearest to the sensor first.

    PX4's HIGHRES_IMU has the estimator's biases of both sensors subtracted, which follow the very errors that are
    sought, unless EKF2_IMU_CTRL's bits 0 and 1 are clear; and PX4 sends no RAW_IMU.
    """
    if firmware != PX4:
        return (DATAFLASH, HIGHRES, RAW, *SCALED_ORDER)
    control = parameters.get(EKF2_IMU_CTRL)
    unbiased = control is not None and not int(control) & BIASES
    return (HIGHRES, *SCALED_ORDER) if unbiased else SCALED_ORDER


# of a low pass: firmwares take whole Hz, and 0 for none
LEAST_HZ = 1.0


def accel_lag_s(parameters: Mapping[str, float]) -> float:
    """By how much an autopilot's low passes make its accelerometers later than its gyroscopes; 0 where it did not say.

    A Butterworth filter of order 2 delays what is slow by sqrt(2) / (2 pi f).
    """
    cutoffs = [parameters.get(name) for name in FILTERS]
    delays = [math.sqrt(2.0) / (2.0 * math.pi * f) if f >= LEAST_HZ else 0.0 for f in cutoffs if f is not None]
    return delays[0] - delays[1] if len(delays) == len(FILTERS) else 0.0
