"""A calibration as a module for MicroPython or CircuitPython, without NumPy: `apply` and `apply_gyro` of one sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2
from ..result.calibration import Calibration
from .losses import heading, temperature_range
from .templates import fill, row, rows

FORM = ".9g"


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the module's text, with `notes` in its heading."""
    sensor = calibration.sensor
    return fill(
        "micropython.py",
        heading="\n".join(heading(calibration, notes, "# ", "m/s^2, rad/s")),
        inv_D=rows(calibration.inverse, FORM, "()"),
        b_a=row(calibration.b_a_to_subtract, FORM),
        K=rows(calibration.K, FORM, "()"),
        b_omega=row(np.nan_to_num(calibration.b_omega), FORM),
        slope=row(calibration.b_a_slope, FORM),
        temperatures=row(temperature_range(calibration), FORM),
        ranges=f"{sensor.accel_range_g}, {sensor.gyro_range_dps}",
        mps2_per_g_count=f"{STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS:.9g}",
        rad_s_per_dps_count=f"{np.radians(1) / GYRO_COUNTS:.9g}",
    )
