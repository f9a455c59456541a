"""A calibration as YAML for ROS: what imu_calib's apply node reads, with the noise that filters ask for.

imu_calib (dpkoch/imu_calib, AccelCalib::applyCalib) publishes SM raw - bias: its bias is taken away after the matrix,
so that SM = inv(D) and bias = inv(D) b_a. It ignores keys that it does not know.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Vector
from ..result.calibration import Calibration
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
    for key, noise in (
        ("linear_acceleration_covariance", calibration.noise_std),
        ("angular_velocity_covariance", calibration.gyro_noise_std),
    ):
        if np.isfinite(noise).all():
            lines.append(f"{key}: {_row(np.diag(noise**2).ravel(), digits=6)}")
    return "\n".join(lines) + "\n"


def _row(values: Vector, digits: int = 12) -> str:
    # YAML takes 1e-05 for a word: a number needs its point
    return "[" + ", ".join(np.format_float_positional(v, precision=digits, trim="0") for v in values) + "]"
