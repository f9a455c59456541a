"""ArduPilot and PX4 by name, and which of their IMU messages a calibration takes."""

from __future__ import annotations

from collections.abc import Mapping

from .imu import DATAFLASH, HIGHRES, RAW

ARDUPILOT, PX4 = "ArduPilot", "PX4"

EKF2_IMU_CTRL, ACCEL_BIAS = "EKF2_IMU_CTRL", 1 << 1

SCALED_ORDER = ("SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3")


def preferred_messages(firmware: str, parameters: Mapping[str, float]) -> tuple[str, ...]:
    """Names of the messages to calibrate from, those nearest to the sensor first.

    PX4's HIGHRES_IMU has the estimator's bias subtracted, which follows the very errors that are sought, unless
    EKF2_IMU_CTRL's bit 1 is clear; and PX4 sends no RAW_IMU.
    """
    if firmware != PX4:
        return (DATAFLASH, HIGHRES, RAW, *SCALED_ORDER)
    control = parameters.get(EKF2_IMU_CTRL)
    unbiased = control is not None and not int(control) & ACCEL_BIAS
    return (HIGHRES, *SCALED_ORDER) if unbiased else SCALED_ORDER
