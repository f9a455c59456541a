"""Scale factor error, misalignment and bias of a sensor: the single definition of each.

A sensor reads y = M s + b, with s in the body frame (the one in which K is symmetric). For the accelerometer M = D and
b = b_a; for the gyroscope M = inv(K) and b = b_omega.

    scale factor error of axis i    100 (M_ii - 1)             %
    misalignment i->j               atan2(M_ij, M_ii)          deg, i != j
    bias of axis i                  1000 b_i / 9.80665         mg (deg/s of a gyroscope)

The diagonal of M holds the scale factors and the other elements the cross-coupling, as in P. D. Groves, Principles of
GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed., section 4.4. Misalignment i->j is the angle by
which the sensitive axis i leans towards the body's axis j. Standard deviations (1 sigma) are
propagated to first order without correlations.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import STANDARD_GRAVITY_MPS2, Vector

MG_PER_MPS2 = 1000.0 / STANDARD_GRAVITY_MPS2


def scale_factor_error(M: Vector) -> Vector:
    """Return (..., 3) % of x, y, z from matrices M (..., 3, 3)."""
    return 100.0 * (_diagonal(M) - 1.0)


def scale_factor_error_std(M_std: Vector) -> Vector:
    """Return (..., 3) % from the standard deviations (..., 3, 3) of M."""
    return 100.0 * _diagonal(M_std)


def misalignment(M: Vector) -> Vector:
    """Return (..., 3, 3) deg, where [i, j] is misalignment i->j; NaN on the diagonal."""
    return _off_diagonal(np.degrees(np.arctan2(M, _diagonal(M)[..., None])))


def misalignment_std(M: Vector, M_std: Vector) -> Vector:
    """Return the standard deviations (..., 3, 3) of `misalignment` [deg]; NaN on the diagonal."""
    along, along_std = _diagonal(M)[..., None], _diagonal(M_std)[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        std = np.degrees(np.hypot(along * M_std, M * along_std) / (M**2 + along**2))
    return _off_diagonal(std)


def _off_diagonal(angle: Vector) -> Vector:
    """Return angles with NaN on the diagonal: no axis is misaligned to itself."""
    return np.where(np.eye(3, dtype=bool), np.nan, angle)


def _diagonal(M: Vector) -> Vector:
    return np.diagonal(M, axis1=-2, axis2=-1)


def bias_mg(b: Vector) -> Vector:
    """Return a bias, or its standard deviation, (...) m/s^2 in mg; 1 mg is a thousandth of standard gravity."""
    return np.asarray(MG_PER_MPS2 * b)


def mg_text(b: Vector, decimals: int = 0) -> str:
    """Return a bias (3,) m/s^2 as text in mg, without the unit."""
    return ", ".join(f"{value:+.{decimals}f}" for value in bias_mg(b))


def with_std(value: float, std: float, most_digits: int = 5) -> str:
    """Return "value ± standard uncertainty", to the second digit of the latter."""
    if not math.isfinite(value):
        return "unknown"
    if not math.isfinite(std) or std <= 0.0:
        return f"{value:+.3f} ± ?"
    digits = min(max(1 - math.floor(math.log10(std)), 0), most_digits)
    return f"{value:+.{digits}f} ± {std:.{digits}f}"


def error_before(D: Vector, b: Vector, gravity: float) -> float:
    """Return the rms error [m/s^2] over all orientations at rest of an uncalibrated sensor with D (3, 3) and b (3,).

    The mean of |(D - I) s + b|^2 over the sphere |s| = g is g^2 / 3 |D - I|_F^2 + |b|^2.
    """
    return float(np.sqrt(gravity**2 / 3.0 * np.sum((D - np.eye(3)) ** 2) + np.sum(b**2)))


def nearest_rotation(M: NDArray[np.floating[Any]]) -> Vector:
    """Return the orthogonal matrix (3, 3) nearest to M (3, 3): U V^T of M = U S V^T."""
    U, _, Vt = np.linalg.svd(M)
    return np.asarray(U @ Vt)


def to_body_frame(D: Vector, K: NDArray[np.floating[Any]]) -> tuple[Vector, Vector, Vector]:
    """Return D Q^T, the symmetric Q K, and Q, the inverse of the rotation nearest to K."""
    Q = nearest_rotation(K).T
    symmetric = Q @ K
    return np.asarray(D @ Q.T), np.asarray((symmetric + symmetric.T) / 2), Q


def sensor_axes(M: Vector) -> Vector:
    """Return M (3, 3) along the sensor's own axes: M Q^T, with Q the rotation nearest to M.

    Its diagonal holds the scale factors of a sensor whose axes are swapped, mirrored or turned against the body's.
    """
    return np.asarray(M @ nearest_rotation(M).T)
