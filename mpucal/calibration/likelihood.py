"""V(theta), its gradient and its Fisher matrix over a recording, by the kernel. Knows no minimiser."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..data import Recording, Vector
from ..kernel import _kernel
from .model import B_A_NAMES, B_OMEGA_NAMES, D_NAMES, Flat, tangents

TILT_NAMES = ("tilt_0", "tilt_1")
K_NAMES = ("K_xx", "K_xy", "K_xz", "K_yy", "K_yz", "K_zz")
R_NAMES = ("r_x", "r_y", "r_z")

NAMES = (*D_NAMES, *B_A_NAMES, *TILT_NAMES, *B_OMEGA_NAMES, *K_NAMES, "sigma_h", *R_NAMES)
# where the kernel keeps each of them (Lanes in kernel/filter.hpp)
LANES = np.array([0, 1, 2, 4, 5, 6, 8, 9, 10, 3, 7, 11, 15, 16, 12, 13, 14, *range(17, 27)])
# lane groups that hold the first so many parameters
GROUPS = {17: 5, 23: 6, 27: 7}


@dataclass(frozen=True)
class Theta:
    """All parameters of the model; those that a method does not estimate keep their neutral value.

    Attributes
    ----------
    D : (3, 3). b_a : (3,) m/s^2. b_omega : (3,) rad/s. K : (3, 3) symmetric.
    sigma_h : m/s^2, the hand's acceleration. r : (3,) m, the lever arm.
    u : (3,) unit, gravity's direction in the body frame at the start (two parameters: tilts about it).
    """

    D: Vector
    b_a: Vector
    b_omega: Vector
    u: Vector
    K: Vector
    sigma_h: float
    r: Vector

    @classmethod
    def start(cls, D: Vector, b_a: Vector, b_omega: Vector, u: Vector) -> Theta:
        """A perfect gyro and no hand."""
        return cls(D, b_a, b_omega, u, np.eye(3), 0.0, np.zeros(3))

    def moved(self, delta: Vector) -> Theta:
        """theta + delta, delta (p,) in the order of NAMES; the tilts turn u and keep it a unit vector."""
        d = np.zeros(len(NAMES))
        d[: len(delta)] = delta
        first, second = tangents(self.u)
        u = self.u + d[12] * first + d[13] * second
        xx, xy, xz, yy, yz, zz = d[17:23]
        return replace(
            self,
            D=self.D + d[:9].reshape(3, 3),
            b_a=self.b_a + d[9:12],
            u=u / np.linalg.norm(u),
            b_omega=self.b_omega + d[14:17],
            K=self.K + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
            sigma_h=self.sigma_h + d[23],
            r=self.r + d[24:27],
        )

    def packed(self) -> Vector:
        """The kernel's layout: D, b_a, b_omega, K, sigma_h, r, u, and u's derivatives by the tilts."""
        return np.concatenate(
            [self.D.ravel(), self.b_a, self.b_omega, self.K.ravel(), [self.sigma_h], self.r, self.u, *tangents(self.u)]
        )


@dataclass(frozen=True)
class Series:
    """What the filter runs over, one row a sample after the flat segment; None stands for the value in brackets.

    Attributes
    ----------
    y : (n, 3) m/s^2. omega : (n, 3) rad/s, the mean measured rate over the step that leads to the sample.
    dt : (n,) s, that step. r_scale, q_scale : (n,) factors of Sigma_a and Sigma_omega [1].
    q_extra : (n,) rad^2 added to the step's angle variance [0]. motion : (n,) factor of sigma_h^2 [0].
    rate, alpha : (n, 3) rad/s, rad/s^2 at the sample, for the lever arm [no lever arm].
    """

    y: Vector
    omega: Vector
    dt: Vector
    r_scale: Vector | None = None
    q_scale: Vector | None = None
    q_extra: Vector | None = None
    motion: Vector | None = None
    rate: Vector | None = None
    alpha: Vector | None = None

    def __len__(self) -> int:
        return len(self.dt)

    @classmethod
    def after(cls, recording: Recording, flat: Flat) -> Series:
        """The samples after the flat segment, with midpoint rates (omega_t + omega_t+1) / 2."""
        last = flat.last
        gyr = recording.gyr[last - 1 :]
        return cls(
            y=np.ascontiguousarray(recording.acc[last:]),
            omega=0.5 * (gyr[:-1] + gyr[1:]),
            dt=np.diff(recording.t[last - 1 :]),
        )

    def arrays(self) -> dict[str, Any]:
        """Keyword arguments of the kernel."""
        return {name: None if value is None else np.ascontiguousarray(value) for name, value in self.__dict__.items()}


@dataclass(frozen=True)
class Problem:
    """A series with what is constant over it."""

    series: Series
    flat: Flat
    gravity: float
    huber: float = np.inf

    def constants(self) -> Vector:
        """The kernel's layout: gravity, Sigma_a, Sigma_omega, the flat mean, its count, Huber's threshold."""
        flat = self.flat
        return np.array([self.gravity, *flat.Sigma_a, *flat.Sigma_omega, *flat.y, flat.n, self.huber])


class Evaluation(NamedTuple):
    """V, sum of e' S^-1 e over the samples, gradient (p,), Fisher matrix (p, p) in the order of NAMES."""

    V: float
    squares: float
    gradient: Vector
    fisher: Vector


def evaluate(problem: Problem, theta: Theta, parameters: int) -> Evaluation:
    """V(theta) of equation (8) with its derivatives by the first `parameters` (17, 23 or 27) of NAMES; 0: V alone."""
    groups = GROUPS[parameters] if parameters else 0
    V, squares, gradient, fisher = _kernel.evaluate(
        theta.packed(), problem.constants(), groups, **problem.series.arrays()
    )
    lanes = LANES[:parameters]
    return Evaluation(V, squares, gradient[lanes], fisher[np.ix_(lanes, lanes)])


def trace(problem: Problem, theta: Theta) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Whitened innovations (n, 3) and predicted gravity (n, 3) m/s^2 of every sample."""
    innovation, gravity = _kernel.trace(theta.packed(), problem.constants(), **problem.series.arrays())
    return innovation, gravity
