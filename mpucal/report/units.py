"""The rows that the report and the terminal show of a calibration: %, mg and degrees with their standard deviations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Vector
from ..result import error_model
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
    bias = Measured("bias", "mg", error_model.bias_mg(c.b_a), error_model.bias_mg(c.b_a_std))
    return [_gain(c.D, c.D_std), bias, *_leans(c.D, c.D_std)]


def gyroscope(c: Calibration) -> list[Measured]:
    """Likewise of the gyroscope, y = inv(K) w + b_omega: what is wrong with it, not what mends it."""
    known = np.isfinite(c.K).all() and np.linalg.matrix_rank(c.K) == 3
    matrix = np.asarray(np.linalg.inv(c.K)) if known else unknown(3, 3)
    # the deviations of inv(K) are those of K to first order, which is what a K near the identity is good for
    bias = Measured("bias", "deg/s", np.degrees(c.b_omega), np.degrees(c.b_omega_std))
    return [_gain(matrix, c.K_std), bias, *_leans(matrix, c.K_std)]


def _gain(matrix: Vector, std: Vector) -> Measured:
    value = error_model.scale_factor_error(matrix)
    return Measured("gain error", "%", value, error_model.scale_factor_error_std(std))


def _leans(matrix: Vector, std: Vector) -> list[Measured]:
    lean, lean_std = error_model.misalignment(matrix), error_model.misalignment_std(matrix, std)
    return [Measured(f"lean to {axis}", "deg", lean[:, j], lean_std[:, j]) for j, axis in enumerate(error_model.AXES)]


def with_std(value: float, std: float, most_digits: int = 5) -> str:
    """A value ± its standard deviation, to the second digit of that."""
    if not math.isfinite(value):
        return "unknown"
    if not math.isfinite(std) or std <= 0.0:
        return f"{value:+.3f} ± ?"
    digits = min(max(1 - math.floor(math.log10(std)), 0), most_digits)
    return f"{value:+.{digits}f} ± {std:.{digits}f}"
