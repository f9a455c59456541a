"""A calibration as a Python module that needs NumPy alone: `apply` for accelerations, `apply_gyro` for rates."""

from __future__ import annotations

import numpy as np

from ..report.use import in_python, py_matrix
from ..result.calibration import Calibration
from .losses import check_usable, head, with_hardware, without_temperature

ENDING = ".py"


def export(calibration: Calibration) -> tuple[str, tuple[str, ...]]:
    """The module's text, and what it cannot carry.

    Raises
    ------
    RefusedError : see losses.check_usable.
    """
    check_usable(calibration)
    notes = (*without_temperature(calibration), *with_hardware(calibration))
    b_omega = ", ".join(f"{value:.8f}" for value in np.nan_to_num(calibration.b_omega))
    text = f'''"""{head(calibration)}, rad/s.{"".join(f"{chr(10)}{chr(10)}{note}" for note in notes)}
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
    return text, notes
