"""A calibration as YAML for ROS: what imu_calib's apply node reads, with the noise that filters ask for.

imu_calib (dpkoch/imu_calib, AccelCalib::applyCalib) publishes SM raw - bias: its bias is taken away after the matrix,
so that SM = inv(D) and bias = inv(D) b_a. It ignores keys that it does not know.
"""

from __future__ import annotations

import numpy as np

from ..data import Vector
from ..report.use import inverse, left_to_subtract
from ..result.calibration import Calibration
from .losses import check_usable, head, with_hardware, without_gyroscope, without_temperature

ENDING = ".yaml"


def export(calibration: Calibration) -> tuple[str, tuple[str, ...]]:
    """The file's text, and what it cannot carry.

    Raises
    ------
    RefusedError : see losses.check_usable.
    """
    check_usable(calibration)
    notes = (*without_gyroscope(calibration), *without_temperature(calibration), *with_hardware(calibration))
    SM = inverse(calibration)
    lines = [
        *(f"# {line}" for line in (f"{head(calibration)}.", *notes)),
        "# corrected = SM * raw - bias, as imu_calib's apply_calib does: bias is inv(D) b_a",
        f"SM: {_row(SM.ravel())}",
        f"bias: {_row(SM @ left_to_subtract(calibration))}",
    ]
    for key, noise in (
        ("linear_acceleration_covariance", calibration.noise_std),
        ("angular_velocity_covariance", calibration.gyro_noise_std),
    ):
        if np.isfinite(noise).all():
            lines.append(f"{key}: {_row(np.diag(noise**2).ravel(), digits=6)}")
    return "\n".join(lines) + "\n", notes


def _row(values: Vector, digits: int = 12) -> str:
    # YAML takes 1e-05 for a word: a number needs its point
    return "[" + ", ".join(np.format_float_positional(v, precision=digits, trim="0") for v in values) + "]"
