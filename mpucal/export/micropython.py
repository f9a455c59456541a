"""A calibration as a module for MicroPython or CircuitPython, without NumPy: `apply` and `apply_gyro` of one sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Vector
from ..result.calibration import Calibration
from .losses import head


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """The module's text, with `notes` in its head."""
    remarks = "\n".join(f"# {line}" for line in (f"{head(calibration)}, rad/s.", *notes))
    return f"""{remarks}

INV_D = {_rows(calibration.inverse)}
B_A = {_row(calibration.b_a_to_subtract)}
K = {_rows(calibration.K)}
B_OMEGA = {_row(np.nan_to_num(calibration.b_omega))}


def _corrected(M, y, b):
    x, y, z = y[0] - b[0], y[1] - b[1], y[2] - b[2]
    return tuple(row[0] * x + row[1] * y + row[2] * z for row in M)


def apply(y):
    # calibrated acceleration (x, y, z) [m/s^2] of a measured one
    return _corrected(INV_D, y, B_A)


def apply_gyro(y):
    # calibrated rate (x, y, z) [rad/s] of a measured one
    return _corrected(K, y, B_OMEGA)
"""


def _rows(matrix: Vector) -> str:
    return "(\n" + "".join(f"    {_row(row)},\n" for row in matrix) + ")"


def _row(values: Vector) -> str:
    return f"({', '.join(f'{value:.9g}' for value in values)})"
