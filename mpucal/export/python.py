"""A calibration as a Python module that needs NumPy alone: `apply` for accelerations, `apply_gyro` for rates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..result.calibration import Calibration
from .code import in_python, py_matrix
from .losses import head


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """The module's text, with `notes` in its head."""
    b_omega = ", ".join(f"{value:.12g}" for value in np.nan_to_num(calibration.b_omega))
    return f'''"""{head(calibration)}, rad/s.{"".join(f"{chr(10)}{chr(10)}{note}" for note in notes)}
"""

{in_python(calibration)}

K = np.array([
{py_matrix(calibration.K)},
])
B_OMEGA = np.array([{b_omega}])  # rad/s


def apply_gyro(y):
    """Calibrated rates (..., 3) [rad/s] of measured ones."""
    return (np.asarray(y) - B_OMEGA) @ K.T
'''
