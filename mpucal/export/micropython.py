"""A calibration as a module for MicroPython or CircuitPython, without NumPy: `apply` and `apply_gyro` of one sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Vector
from ..result.calibration import Calibration
from .losses import heading, temperature_range


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the module's text, with `notes` in its heading."""
    remarks = "\n".join(heading(calibration, notes, "# ", "m/s^2, rad/s"))
    at, start, end = temperature_range(calibration)
    range_g, range_dps = calibration.sensor.accel_range_g, calibration.sensor.gyro_range_dps
    return f"""{remarks}

INV_D = {_rows(calibration.inverse)}
B_A = {_row(calibration.b_a_to_subtract)}
K = {_rows(calibration.K)}
B_OMEGA = {_row(np.nan_to_num(calibration.b_omega))}
B_A_SLOPE = {_row(calibration.b_a_slope)}  # m/s^2 per degree Celsius
AT_C, FROM_C, TO_C = {at:.9g}, {start:.9g}, {end:.9g}
RANGE_G, RANGE_DPS = {range_g}, {range_dps}


def _corrected(M, y, b):
    x, y, z = y[0] - b[0], y[1] - b[1], y[2] - b[2]
    return tuple(row[0] * x + row[1] * y + row[2] * z for row in M)


def apply(y, temperature_c=None):
    # return the calibrated acceleration (x, y, z) [m/s^2], at the chip's deg C if known
    if temperature_c is None or temperature_c != temperature_c:
        temperature_c = AT_C
    away = min(max(temperature_c, FROM_C), TO_C) - AT_C
    return _corrected(INV_D, y, [b + s * away for b, s in zip(B_A, B_A_SLOPE)])


def apply_gyro(y):
    # return the calibrated rate (x, y, z) [rad/s]
    return _corrected(K, y, B_OMEGA)


def _measured(counts, used, calibrated, unit):
    if calibrated not in (None, used):
        raise ValueError("calibrated at a range of %s, not %s" % (calibrated, used))
    return [count * used * unit for count in counts]


def apply_counts(counts, range_g, temperature_c=None):
    # return the calibrated acceleration of the chip's counts at +-range_g, its setting
    return apply(_measured(counts, range_g, RANGE_G, {STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS:.9g}), temperature_c)


def apply_gyro_counts(counts, range_dps):
    return apply_gyro(_measured(counts, range_dps, RANGE_DPS, {np.radians(1) / GYRO_COUNTS:.9g}))
"""


def _rows(matrix: Vector) -> str:
    return "(\n" + "".join(f"    {_row(row)},\n" for row in matrix) + ")"


def _row(values: Vector) -> str:
    return f"({', '.join(f'{value:.9g}' for value in values)})"
