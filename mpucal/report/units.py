"""A calibration in the units that people use: %, mg, degrees. Knows no page and no terminal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..result.calibration import Calibration, unknown


@dataclass(frozen=True)
class Measured:
    """A row of numbers with their standard deviations, NaN where unknown.

    Attributes
    ----------
    name, unit : of the row. value, std : (3,) of x, y and z.
    """

    name: str
    unit: str
    value: Vector
    std: Vector


def accelerometer(c: Calibration) -> list[Measured]:
    """Gain error, bias, and how far each axis leans towards the other two; NaN where that is itself."""
    gain = Measured("gain error", "%", 100.0 * (np.diag(c.D) - 1.0), 100.0 * np.diag(c.D_std))
    to_mg = 1000.0 / STANDARD_GRAVITY_MPS2
    return [gain, Measured("bias", "mg", to_mg * c.b_a, to_mg * c.b_a_std), *_leans(c.D, c.D_std)]


def gyroscope(c: Calibration) -> list[Measured]:
    """Likewise of the gyroscope, y = inv(K) w + b_omega: what is wrong with it, not what mends it."""
    known = np.isfinite(c.K).all() and np.linalg.matrix_rank(c.K) == 3
    matrix = np.asarray(np.linalg.inv(c.K)) if known else unknown(3, 3)
    # the deviations of inv(K) are those of K to first order, which is what a K near the identity is good for
    gain = Measured("gain error", "%", 100.0 * (np.diag(matrix) - 1.0), 100.0 * np.diag(c.K_std))
    bias = Measured("bias", "deg/s", np.degrees(c.b_omega), np.degrees(c.b_omega_std))
    return [gain, bias, *_leans(matrix, c.K_std)]


def _leans(matrix: Vector, std: Vector) -> list[Measured]:
    diagonal = np.diag(matrix)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        lean, lean_std = (np.degrees(values / diagonal) for values in (matrix, std))
    for values in (lean, lean_std):
        np.fill_diagonal(values, np.nan)
    return [Measured(f"lean to {axis}", "deg", lean[:, j], np.abs(lean_std[:, j])) for j, axis in enumerate("xyz")]


def with_std(value: float, std: float, most_digits: int = 5) -> str:
    """A value ± its standard deviation, to the second digit of that."""
    if not math.isfinite(value):
        return "unknown"
    if not math.isfinite(std) or std <= 0.0:
        return f"{value:+.3f} ± ?"
    digits = min(max(1 - math.floor(math.log10(std)), 0), most_digits)
    return f"{value:+.{digits}f} ± {std:.{digits}f}"
