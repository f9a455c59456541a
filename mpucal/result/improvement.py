"""Whether a new correction is predicted to be better than the one that is there."""

from __future__ import annotations

import math

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Vector
from .calibration import Calibration

# a covariance holds chance alone: what is better by less than this is not called better
LEAST_STD_MPS2 = 0.001


def is_better(new_mps2: float, old_mps2: float, std_mps2: float) -> bool:
    """Whether |a| will be nearer to g with the new correction.

    Parameters
    ----------
    new_mps2, old_mps2 : what each leaves wrong at worst, were the calibration exact. std_mps2 : its standard
        uncertainty. That of the calibration hides in both: the old one's square is too large by its square, and the
        new one's too small.
    """
    std_mps2 = max(std_mps2, LEAST_STD_MPS2)
    return old_mps2**2 - std_mps2**2 > new_mps2**2 + std_mps2**2


def left_wrong(true: Calibration, D: Vector, b_a: Vector) -> float:
    """By how much |a| is wrong at worst [m/s^2], whatever the attitude, where `true` holds and D, b_a correct.

    a = inv(D) (D_true s + b_true - b_a): the singular values of inv(D) D_true bound what the scale does to |a|.
    """
    gravity = float(true.fit.get("gravity") or STANDARD_GRAVITY_MPS2)
    singular = np.linalg.svd(np.linalg.solve(D, true.D), compute_uv=False)
    bias = np.linalg.norm(np.linalg.solve(D, true.b_a - b_a))
    return float(gravity * np.abs(singular - 1.0).max() + (bias if math.isfinite(bias) else math.inf))
