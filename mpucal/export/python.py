"""A calibration as a Python module that needs only NumPy: `apply` for accelerations, `apply_gyro` for rates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..result.calibration import Calibration
from .losses import heading, temperature_range
from .templates import fill, row, rows

FORM = ".12g"


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the module's text, with `notes` in its docstring."""
    return fill(
        "module.py",
        heading="\n\n".join(heading(calibration, notes, "", "m/s^2, rad/s")),
        inv_D=rows(calibration.inverse, FORM, "[]"),
        b_a=row(calibration.b_a_to_subtract, FORM),
        slope=row(calibration.b_a_slope, FORM),
        temperatures=row(temperature_range(calibration), ".6g"),
        K=rows(calibration.K, FORM, "[]"),
        b_omega=row(np.nan_to_num(calibration.b_omega), FORM),
    )
