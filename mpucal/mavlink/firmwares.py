"""ArduPilot and PX4 by name, and which of their IMU messages a calibration takes."""

from __future__ import annotations

from collections.abc import Mapping

from .imu import DATAFLASH, HIGHRES, RAW

ARDUPILOT, PX4 = "ArduPilot", "PX4"

# of which bit 0 has the estimator learn the gyroscope's bias, bit 1 the accelerometer's
EKF2_IMU_CTRL, BIASES = "EKF2_IMU_CTRL", 0b11

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
