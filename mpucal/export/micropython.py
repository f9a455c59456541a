"""A calibration as a module for MicroPython or CircuitPython, without NumPy: `apply` and `apply_gyro` of one sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Vector
from ..result.calibration import Calibration
from .losses import heading, temperature_range
from .templates import fill


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the module's text, with `notes` in its heading."""
    sensor = calibration.sensor
    return fill(
        "micropython.py",
        heading="\n".join(heading(calibration, notes, "# ", "m/s^2, rad/s")),
        inv_D=_rows(calibration.inverse),
        b_a=_row(calibration.b_a_to_subtract),
        K=_rows(calibration.K),
        b_omega=_row(np.nan_to_num(calibration.b_omega)),
        slope=_row(calibration.b_a_slope),
        temperatures=", ".join(f"{value:.9g}" for value in temperature_range(calibration)),
        ranges=f"{sensor.accel_range_g}, {sensor.gyro_range_dps}",
        mps2_per_g_count=f"{STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS:.9g}",
        rad_s_per_dps_count=f"{np.radians(1) / GYRO_COUNTS:.9g}",
    )


def _rows(matrix: Vector) -> str:
    return "(\n" + "".join(f"    {_row(row)},\n" for row in matrix) + ")"


def _row(values: Vector) -> str:
    return f"({', '.join(f'{value:.9g}' for value in values)})"
