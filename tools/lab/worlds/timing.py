"""Which samples reach a file, and with which times.

Each is a frozen dataclass; `deliver(t, rng)` takes the nominal times (n,) [s] of the samples, and gives the times (m,)
that are written and which samples (m,) they stand beside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mpucal.data import Vector

Rows = NDArray[np.intp]
# of times that must increase
LEAST_S = 1e-5


class Timing(Protocol):
    """One way of delivery."""

    def deliver(self, t: Vector, rng: np.random.Generator) -> tuple[Vector, Rows]:
        """Times, and the samples they stand beside."""
        ...


@dataclass(frozen=True)
class Jitter:
    """Each time is off by a Gaussian error of rms_s; they are in order."""

    rms_s: float = 0.002

    def deliver(self, t: Vector, rng: np.random.Generator) -> tuple[Vector, Rows]:
        """See Timing."""
        return increasing(np.sort(t + self.rms_s * rng.standard_normal(len(t)))), np.arange(len(t))


@dataclass(frozen=True)
class Ticks:
    """Times are whole ticks; a sample that falls into the tick of the one before is lost."""

    tick_s: float = 0.004

    def deliver(self, t: Vector, rng: np.random.Generator) -> tuple[Vector, Rows]:
        """See Timing."""
        ticks, rows = np.unique(np.floor((t + rng.uniform(0, self.tick_s)) / self.tick_s), return_index=True)
        return ticks * self.tick_s, rows


@dataclass(frozen=True)
class Bursts:
    """The host stamps samples as they come over a link that delivers `count` at once."""

    count: int = 8
    late_s: float = 0.004

    def deliver(self, t: Vector, rng: np.random.Generator) -> tuple[Vector, Rows]:
        """See Timing."""
        burst, place = np.divmod(np.arange(len(t)), self.count)
        arrived = t[np.minimum((burst + 1) * self.count, len(t)) - 1] + self.late_s * rng.random(burst[-1] + 1)[burst]
        return increasing(arrived + 5e-5 * place), np.arange(len(t))


@dataclass(frozen=True)
class Dropped:
    """A share of the samples is lost, and one stretch of stretch_s; times are right."""

    share: float = 0.05
    stretch_s: float = 0.0

    def deliver(self, t: Vector, rng: np.random.Generator) -> tuple[Vector, Rows]:
        """See Timing."""
        start = rng.uniform(0.3, 0.9) * t[-1]
        kept = (rng.random(len(t)) >= self.share) & ((t < start) | (t >= start + self.stretch_s))
        return t[kept], np.flatnonzero(kept)


@dataclass(frozen=True)
class EachTwice:
    """Read at twice the rate at which it measures: every sample comes twice, at evenly spaced times."""

    def deliver(self, t: Vector, rng: np.random.Generator) -> tuple[Vector, Rows]:
        """See Timing."""
        half = 0.5 * float(np.median(np.diff(t)))
        return np.stack((t, t + half), axis=1).ravel(), np.repeat(np.arange(len(t)), 2)


@dataclass(frozen=True)
class Polled:
    """A loop reads the newest sample at its own rate of poll_hz, late by up to late_s, and writes its own time."""

    poll_hz: float = 230.0
    late_s: float = 0.0005

    def deliver(self, t: Vector, rng: np.random.Generator) -> tuple[Vector, Rows]:
        """See Timing."""
        n = int((t[-1] - t[0]) * self.poll_hz)
        times = t[0] + np.arange(n) / self.poll_hz + self.late_s * rng.random(n)
        return times, np.searchsorted(t, times, side="right") - 1


def increasing(t: Vector) -> Vector:
    """The same times, each LEAST_S after the one before it at least."""
    least = LEAST_S * np.arange(len(t))
    return np.asarray(np.maximum.accumulate(t - least) + least)
