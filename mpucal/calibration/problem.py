"""Problem for a filter: the series of a recording, and what is constant over it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..data import Recording, Vector
from ..kernel import _kernel
from ..rests.flat import Flat


@dataclass(frozen=True)
class Series:
    """Series of samples after the flat segment, a row each; None stands for the value in brackets.

    Attributes
    ----------
    y : (n, 3) m/s^2. omega : (n, 3) rad/s, the mean measured rate over the step that leads to the sample.
    dt : (n,) s, that step. r_scale, q_scale : (n,) factors of Sigma_a and Sigma_omega [1].
    q_extra : (n,) rad^2 added to the step's angle variance [0].

    The hand's filter alone uses these:

    rate, alpha : (n, 3) rad/s, rad/s^2 at the sample, for lever arm and delay [neither].
    r_extra : (n,) (m/s^2)^2 added to the noise of every axis [0].
    jerk : (n,) (m/s^3)^2/Hz, spectral density of the hand's jerk over the step that leads to the sample [0].
    reset : (n,) m/s^2, not below zero where the hand comes to rest or leaves it: its travel begins again as in a long
        rest, with this standard deviation of its acceleration [nowhere].
    force : (n, 3) m/s^2 over the step that leads to the sample, less that of the flat segment, for the derivatives by
        the gyroscope's sensitivity S to it [none].
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
    force: Vector | None = None

    def __len__(self) -> int:
        return len(self.dt)

    @classmethod
    def after(cls, recording: Recording, flat: Flat) -> Series:
        """Return the samples after the flat segment, with the mean rates from sample to sample."""
        dt = np.diff(recording.t[flat.last - 1 :])
        omega = _kernel.mean_rates(np.ascontiguousarray(recording.gyr), flat.b_omega, dt)
        return cls(y=np.ascontiguousarray(recording.acc[flat.last :]), omega=omega, dt=dt)

    def arrays(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Return the named fields as the kernel's keyword arguments."""
        return {name: getattr(self, name) for name in names}


SERIES = ("y", "omega", "dt", "r_scale", "q_scale", "q_extra")

SERIES_OF_A_HAND = ("rate", "alpha", "r_extra", "jerk", "reset", "force")


@dataclass(frozen=True)
class Problem:
    """Series with what is constant over it; the hand's filter alone uses huber, tail and lam.

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

    def first(self, n: int) -> Problem:
        """Return the problem of the first n samples."""
        given = {f.name: x[:n] for f in fields(Series) if (x := getattr(self.series, f.name)) is not None}
        return replace(self, series=Series(**given))

    def with_forces(self) -> Problem:
        """Return the problem with the forces for derivatives by the gyroscope's sensitivity to acceleration."""
        flat = self.flat.y
        y = np.vstack([flat, self.series.y])
        return replace(self, series=replace(self.series, force=0.5 * (y[1:] + y[:-1]) - flat))

    def constants(self) -> Vector:
        """Return the exact filter's constants: gravity, Sigma_a, Sigma_omega, the flat mean, its count."""
        flat = self.flat
        return np.concatenate([[self.gravity], flat.Sigma_a, flat.Sigma_omega, flat.y, [flat.worth]])

    def constants_of_a_hand(self) -> Vector:
        """Return the hand's filter's constants: the exact one's, then huber, tail and lam."""
        return np.concatenate([self.constants(), [self.huber, self.tail, self.lam]])
