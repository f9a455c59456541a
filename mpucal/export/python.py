"""A calibration as a Python module that needs only NumPy: `apply` for accelerations, `apply_gyro` for rates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Vector
from ..result.calibration import Calibration
from .losses import heading, temperature_range
from .templates import fill


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the module's text, with `notes` in its docstring."""
    return fill(
        "module.py",
        heading="\n\n".join(heading(calibration, notes, "", "m/s^2, rad/s")),
        inv_D=_rows(calibration.inverse),
        b_a=_row(calibration.b_a_to_subtract),
        slope=_row(calibration.b_a_slope),
        temperatures=", ".join(f"{value:.6g}" for value in temperature_range(calibration)),
        K=_rows(calibration.K),
        b_omega=_row(np.nan_to_num(calibration.b_omega)),
    )


def _rows(matrix: Vector) -> str:
    return ",\n".join(f"    [{_row(row)}]" for row in matrix)


def _row(values: Vector) -> str:
    return ", ".join(f"{value:.12g}" for value in values)
