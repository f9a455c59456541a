"""What the estimators share: the stationary segment's statistics and what a fit returns. Knows no algorithm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..data import Vector


@dataclass(frozen=True)
class Flat:
    """Line 1 of Algorithm 1: what the stationary segment says.

    Attributes
    ----------
    first, last : samples first..last-1 are the segment.
    y : (3,) m/s^2, mean of the accelerometer. b_omega : (3,) rad/s, mean of the gyroscope.
    Sigma_a : (3,) (m/s^2)^2 and Sigma_omega : (3,) (rad/s)^2, the diagonals of the covariances.
    """

    first: int
    last: int
    y: Vector
    b_omega: Vector
    Sigma_a: Vector
    Sigma_omega: Vector

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.last - self.first


@dataclass(frozen=True)
class Fit:
    """Estimated parameters, whatever the method.

    Attributes
    ----------
    D : (3, 3). b_a : (3,) m/s^2. b_omega : (3,) rad/s. K : (3, 3).
    names : p names of the parameters that were estimated, D row-major first, then b_a.
    covariance : (p, p), in the order of `names`.
    iterations : of the minimiser. converged : whether it met its stopping rule.
    nis : mean of ||e_t||^2 weighted by the inverse of S_t, over all samples; 3 where the model holds.
    V : the cost function (8) at the estimate.
    at_prior : names of those parameters of which the data say little: they are what was known beforehand.
    """

    D: Vector
    b_a: Vector
    b_omega: Vector
    K: Vector
    names: tuple[str, ...]
    covariance: Vector
    iterations: int
    converged: bool
    nis: float
    V: float
    at_prior: tuple[str, ...] = ()

    def std(self, *names: str) -> Vector:
        """Standard deviations of the named parameters, NaN for those that were not estimated."""
        variance = dict(zip(self.names, np.diag(self.covariance), strict=True))
        return np.sqrt([max(variance.get(name, np.nan), 0.0) for name in names])

    def right_handed(self) -> Fit:
        """Of (D, u) and (-D, -u), which fit equally well, the one with det D > 0."""
        if not np.linalg.det(self.D) < 0.0:
            return self
        sign = np.array([-1.0 if name in D_NAMES else 1.0 for name in self.names])
        return replace(self, D=-self.D, covariance=self.covariance * np.outer(sign, sign))


D_NAMES = tuple(f"D_{i}{j}" for i in "xyz" for j in "xyz")
B_A_NAMES = tuple(f"b_a_{i}" for i in "xyz")
B_OMEGA_NAMES = tuple(f"b_omega_{i}" for i in "xyz")


def cross(v: Vector) -> NDArray[np.float64]:
    """[v]x, the matrix of the cross product: (..., 3) -> (..., 3, 3)."""
    matrix = np.zeros((*v.shape[:-1], 3, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return matrix - np.swapaxes(matrix, -1, -2)


def rotation(phi: Vector) -> NDArray[np.float64]:
    """exp([phi]x), the rotation by the vector phi [rad]: (..., 3) -> (..., 3, 3)."""
    angle2 = np.sum(phi * phi, axis=-1)[..., None, None]
    angle = np.sqrt(angle2)
    X = cross(phi)
    # sinc and its companion, finite at zero
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    turn: NDArray[np.float64] = np.eye(3) + a * X + b * (X @ X)
    return turn


def tangents(u: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors (3,) that span the plane across the unit vector u."""
    x, y, z = u.tolist()
    # across the axis that u is farthest from; plain floats, as this runs in every step of a minimiser
    least = min(abs(x), abs(y), abs(z))
    first = (0.0, z, -y) if abs(x) == least else (-z, 0.0, x) if abs(y) == least else (y, -x, 0.0)
    size = math.hypot(*first)
    a, b, c = (value / size for value in first)
    return np.array([a, b, c]), np.array([y * c - z * b, z * a - x * c, x * b - y * a])


def product(F: Vector) -> Vector:
    """F[n-1] ... F[1] F[0] of matrices (n, 3, 3), by halves; the identity of none."""
    if len(F) == 0:
        return np.eye(3)
    while len(F) > 1:
        odd = F[-1:] if len(F) % 2 else F[:0]
        pairs = F[: len(F) - len(odd)]
        F = np.concatenate([pairs[1::2] @ pairs[::2], odd])
    return np.asarray(F[0])
