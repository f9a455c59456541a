"""A calibration as YAML for ROS: what imu_calib's apply node reads, with the noise that filters ask for.

imu_calib (dpkoch/imu_calib, AccelCalib::applyCalib) publishes SM raw - bias: its bias is taken away after the matrix,
so that SM = inv(D) and bias = inv(D) b_a. Its node subtracts the mean of the gyroscope's first samples itself
(calibrate_gyros, which is its default). It ignores keys that it does not know.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Vector
from ..result.calibration import Calibration
from ..result.noise import ACCELEROMETER, GYROSCOPE, KEY, WHITE
from .losses import head


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """The file's text, with `notes` in its head."""
    SM = calibration.inverse
    lines = [
        *(f"# {line}" for line in (f"{head(calibration)}.", *notes)),
        "# corrected = SM * raw - bias, as imu_calib's apply_calib does: bias is inv(D) b_a",
        f"SM: {_row(SM.ravel())}",
        f"bias: {_row(SM @ calibration.b_a_to_subtract)}",
    ]
    known, rate_hz = calibration.extra.get(KEY), calibration.sensor.rate_hz
    for key, sensor, noise in (
        ("linear_acceleration_covariance", ACCELEROMETER, calibration.noise_std),
        ("angular_velocity_covariance", GYROSCOPE, calibration.gyro_noise_std),
    ):
        if known is not None:
            # of one sample
            noise = np.full(3, known[sensor][WHITE] * np.sqrt(rate_hz or known["rate_hz"]))  # noqa: PLW2901
        if np.isfinite(noise).all():
            lines.append(f"{key}: {_row(np.diag(noise**2).ravel())}")
    return "\n".join(lines) + "\n"


def left(calibration: Calibration) -> tuple[str, ...]:
    """What imu_calib does with the gyroscope."""
    scale = 100.0 * float(np.abs(calibration.K - np.eye(3)).max())
    stays = f": up to {scale:.2f} % of a rate stay" if scale else ""
    return (
        "imu_calib subtracts the gyroscope's bias as it is when its node starts, which takes a sensor that is still;"
        f" it does not correct scale factor errors and misalignments of the gyroscope{stays}.",
    )


def _row(values: Vector) -> str:
    # YAML takes 1e-05 for a word: a number needs its point
    return "[" + ", ".join(np.format_float_positional(v, trim="0") for v in values) + "]"
