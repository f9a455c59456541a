"""A calibration as a Python module that needs only NumPy: `apply` for accelerations, `apply_gyro` for rates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Vector
from ..result.calibration import Calibration
from .losses import heading, temperature_range


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the module's text, with `notes` in its docstring."""
    docstring = "\n\n".join(heading(calibration, notes, "", "m/s^2, rad/s"))
    return f'''"""{docstring}
"""

{python_functions(calibration)}

K = np.array([
{_rows(calibration.K)},
])
B_OMEGA = np.array([{_row(np.nan_to_num(calibration.b_omega))}])  # rad/s


def apply_gyro(y):
    """Return calibrated rates (..., 3) [rad/s]."""
    return (np.asarray(y) - B_OMEGA) @ K.T
'''


def python_functions(c: Calibration) -> str:
    """Return constants and `apply` for NumPy."""
    at, start, end = temperature_range(c)
    return f"""import numpy as np

{python_constants(c)}B_A_SLOPE = np.array([{_row(c.b_a_slope)}])  # m/s^2 per degree Celsius
AT_C, RANGE_C = {at:.6g}, ({start:.6g}, {end:.6g})


def apply(y, temperature_c=np.nan):
    \"\"\"Return calibrated accelerations (..., 3) [m/s^2], at the chip's temperature (...) deg C if known.\"\"\"
    away = np.nan_to_num(np.clip(temperature_c, *RANGE_C) - AT_C)
    return (np.asarray(y) - B_A - np.multiply.outer(away, B_A_SLOPE)) @ INV_D.T
"""


def python_constants(c: Calibration) -> str:
    """Return inv(D) and b_a as arrays of NumPy."""
    return f"INV_D = np.array([\n{_rows(c.inverse)},\n])\nB_A = np.array([{_row(c.b_a_to_subtract)}])  # m/s^2\n"


def _rows(matrix: Vector) -> str:
    return ",\n".join(f"    [{_row(row)}]" for row in matrix)


def _row(values: Vector) -> str:
    return ", ".join(f"{value:.12g}" for value in values)
