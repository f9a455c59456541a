"""V(theta), its gradient and its Fisher matrix over a recording, by the kernel. Knows no minimiser.

Two filters: the exact one for a sensor that turns in place, and the hand's, whose state holds the hand's travel as well
(kernel/filter.hpp and kernel/hand.hpp).
"""

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

NAMES = (*D_NAMES, *B_A_NAMES, *TILT_NAMES, *B_OMEGA_NAMES, *K_NAMES, "tau", *R_NAMES)
PLACES = {"D": (0, 9), "b_a": (9, 12), "b_omega": (14, 17), "K": (17, 23), "tau": (23, 24), "r": (24, 27)}
# where the kernel keeps each of them (Lanes in kernel/filter.hpp)
LANES = np.array([0, 1, 2, 4, 5, 6, 8, 9, 10, 3, 7, 11, 15, 16, 12, 13, 14, *range(17, 27)])
# lane groups of the exact filter that hold the first so many parameters
GROUPS = {17: 5, 23: 6}


@dataclass(frozen=True)
class Theta:
    """All parameters of the model; those that a method does not estimate keep their neutral value.

    Attributes
    ----------
    D : (3, 3). b_a : (3,) m/s^2. b_omega : (3,) rad/s. K : (3, 3) symmetric.
    tau : s, by which the accelerometer lags behind the gyroscope. r : (3,) m, the lever arm.
    u : (3,) unit, gravity's direction in the body frame at the start (two parameters: tilts about it).
    """

    D: Vector
    b_a: Vector
    b_omega: Vector
    u: Vector
    K: Vector
    tau: float
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
            tau=self.tau + d[23],
            r=self.r + d[24:27],
        )

    def packed(self) -> Vector:
        """The exact filter's layout: D, b_a, b_omega, K, u, and u's derivatives by the tilts."""
        return np.concatenate([self.D.ravel(), self.b_a, self.b_omega, self.K.ravel(), self.u, *tangents(self.u)])

    def packed_with_hand(self) -> Vector:
        """The hand's filter's layout: the exact filter's, tau, r."""
        return np.concatenate([self.packed(), [self.tau], self.r])


@dataclass(frozen=True)
class Series:
    """What the filter runs over, one row a sample after the flat segment; None stands for the value in brackets.

    Attributes
    ----------
    y : (n, 3) m/s^2. omega : (n, 3) rad/s, the mean measured rate over the step that leads to the sample.
    dt : (n,) s, that step. r_scale, q_scale : (n,) factors of Sigma_a and Sigma_omega [1].
    q_extra : (n,) rad^2 added to the step's angle variance [0].

    What follows is for the hand's filter alone.

    rate, alpha : (n, 3) rad/s, rad/s^2 at the sample, for lever arm and delay [neither].
    r_extra : (n,) (m/s^2)^2 added to the noise of every axis [0].
    jerk : (n,) (m/s^3)^2/Hz, spectral density of the hand's jerk over the step that leads to the sample [0].
    reset : (n,) m/s^2, not below zero where the hand comes to rest or leaves it: its travel begins anew from rest, with
        this standard deviation of its acceleration [nowhere].
    """

    y: Vector
    omega: Vector
    dt: Vector
    r_scale: Vector | None = None
    q_scale: Vector | None = None
    q_extra: Vector | None = None
    rate: Vector | None = None
    alpha: Vector | None = None
    r_extra: Vector | None = None
    jerk: Vector | None = None
    reset: Vector | None = None

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

    def arrays(self, names: tuple[str, ...]) -> dict[str, Any]:
        """The named fields as the kernel's keyword arguments."""
        values = {name: getattr(self, name) for name in names}
        return {name: None if value is None else np.ascontiguousarray(value) for name, value in values.items()}


COMMON = ("y", "omega", "dt", "r_scale", "q_scale", "q_extra")
HAND = ("rate", "alpha", "r_extra", "jerk", "reset")


@dataclass(frozen=True)
class Problem:
    """A series with what is constant over it; huber, tail and lam are the hand's filter's alone.

    Attributes
    ----------
    gravity : m/s^2. huber : threshold on |L^-1 e| beyond which a sample weighs less.
    tail : beyond it, rho grows as the distance (0, Huber) or as its logarithm (1, redescending).
    lam : 1/s, the three poles that bring the hand's travel back.
    """

    series: Series
    flat: Flat
    gravity: float
    huber: float = np.inf
    tail: float = 1.0
    lam: float = 5.0

    def constants(self) -> Vector:
        """The kernel's layout: gravity, Sigma_a, Sigma_omega, the flat mean, its count, then huber, tail and lam."""
        flat = self.flat
        return np.array(
            [self.gravity, *flat.Sigma_a, *flat.Sigma_omega, *flat.y, flat.n, self.huber, self.tail, self.lam]
        )


class Evaluation(NamedTuple):
    """V, sum of e' S^-1 e over the samples, gradient (p,), Fisher matrix (p, p) in the order of NAMES."""

    V: float
    squares: float
    gradient: Vector
    fisher: Vector


def evaluate(problem: Problem, theta: Theta, parameters: int) -> Evaluation:
    """V(theta) with its derivatives by the first `parameters` of NAMES.

    17, 23 (or 0: V alone): equation (8) by the exact filter. 27: by the hand's filter, whose derivatives hold gains and
    weights: the gradient is zero where the estimate should be, not where V is least.

    Raises
    ------
    ValueError : the exact filter was asked of a problem that only the hand's filter can solve.
    """
    if parameters == len(NAMES):
        V, squares, gradient, fisher = _hand(problem, theta, derivatives=True)
    else:
        _refuse_a_hand(problem)
        V, squares, gradient, fisher = _kernel.evaluate(
            theta.packed(),
            problem.constants()[:-3],
            GROUPS[parameters] if parameters else 0,
            **problem.series.arrays(COMMON),
        )
    lanes = LANES[:parameters]
    return Evaluation(V, squares, gradient[lanes], fisher[np.ix_(lanes, lanes)])


def value(problem: Problem, theta: Theta) -> float:
    """V(theta) of the hand's filter."""
    return _hand(problem, theta, derivatives=False)[0]


class Trace(NamedTuple):
    """What the hand's filter made of every sample, (n, 3) each.

    innovation : whitened, L^-1 e. s, a : m/s^2, gravity and the hand's acceleration in the body frame, as predicted.
    """

    innovation: NDArray[np.float64]
    s: NDArray[np.float64]
    a: NDArray[np.float64]


def trace(problem: Problem, theta: Theta) -> Trace:
    """The hand's filter, sample by sample."""
    series = problem.series.arrays(COMMON + HAND)
    return Trace(*_kernel.trace_hand(theta.packed_with_hand(), problem.constants(), **series))


def _hand(problem: Problem, theta: Theta, derivatives: bool) -> tuple[float, float, Vector, Vector]:
    series = problem.series.arrays(COMMON + HAND)
    return _kernel.evaluate_hand(theta.packed_with_hand(), problem.constants(), derivatives, **series)


def _refuse_a_hand(problem: Problem) -> None:
    given = [name for name in HAND if getattr(problem.series, name) is not None]
    given += ["huber"] if np.isfinite(problem.huber) else []
    if given:
        raise ValueError(f"the exact filter knows no {', '.join(given)}: ask for all {len(NAMES)} parameters")
