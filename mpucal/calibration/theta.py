"""A point in the space of all parameters: a step from it, and its layout for the kernel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..data import Vector
from .parameters import NAMES
from .sphere import tangents


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


def values(theta: Theta) -> Vector:
    """(27,) in the order of NAMES; the tilts are zero by definition."""
    K = theta.K
    six = [K[0, 0], K[0, 1], K[0, 2], K[1, 1], K[1, 2], K[2, 2]]
    return np.concatenate([theta.D.ravel(), theta.b_a, [0.0, 0.0], theta.b_omega, six, [theta.tau], theta.r])
