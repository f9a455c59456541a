"""A calibration for ROS: YAML for imu_calib's apply node, with noise covariances.

imu_calib (dpkoch/imu_calib, AccelCalib::applyCalib) publishes SM raw - bias: the bias is subtracted after the matrix,
so SM = inv(D) and bias = inv(D) b_a. Its node subtracts the mean of the gyroscope's first samples itself
(calibrate_gyros, the default). It ignores unknown keys.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..result.calibration import Calibration
from ..result.noise import ACCELEROMETER, GYROSCOPE, KEY, WHITE
from .losses import heading
from .templates import yaml_row


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the file's text, with `notes` in its heading."""
    SM = calibration.inverse
    lines = [
        *heading(calibration, notes, "# "),
        "# corrected = SM * raw - bias, as in imu_calib's apply_calib: bias is inv(D) b_a",
        f"SM: {yaml_row(SM.ravel())}",
        f"bias: {yaml_row(SM @ calibration.b_a_to_subtract)}",
    ]
    known, rate_hz = calibration.extra.get(KEY), calibration.sensor.rate_hz
    for key, sensor, noise in (
        ("linear_acceleration_covariance", ACCELEROMETER, calibration.noise_std),
        ("angular_velocity_covariance", GYROSCOPE, calibration.gyro_noise_std),
    ):
        if known is not None:
            # from a density to one sample
            noise = np.full(3, known[sensor][WHITE] * np.sqrt(rate_hz or known["rate_hz"]))  # noqa: PLW2901
        if np.isfinite(noise).all():
            lines.append(f"{key}: {yaml_row(np.diag(noise**2).ravel())}")
    return "\n".join(lines) + "\n"


def losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on imu_calib's handling of the gyroscope."""
    scale = 100.0 * float(np.abs(calibration.K - np.eye(3)).max())
    remaining = f": up to {scale:.2f} % of a rate remain" if scale else ""
    return (
        "imu_calib subtracts the gyroscope's bias at the start of its node, when the sensor must be still; it does not"
        f" correct scale factor errors and misalignments of the gyroscope{remaining}.",
    )
