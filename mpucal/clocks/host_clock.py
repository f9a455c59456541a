"""Rate of a bus's clock against the host's, from pairs of (bus time, host arrival time).

A reply is delayed by at least the time that the line needs: host_i = t_i + a + delay_i, delay_i > 0. So a line lies
under the pairs, whatever an adapter holds back. Each of a few groups of consecutive pairs gives the one that was least
delayed. With priors of the rate's error and of its drift, the parabola

    host(t) - t = a_k + b (t - t_m) + c (t - t_m)^2

goes through those, b the rate error in the middle of the recording, with an a_k for each run k of pairs: one ends
where a clock restarted, and where the bus was silent, since a bridge may have been reset then. A group's least delay
varies as the distance of its two least delays does (Renyi's spacings), or as the residuals do where these are larger.

Only replies to requests serve, made at times that are not in step with anything: data that a bridge sends by itself
comes at the chip's rate, and drifts through an adapter's bursts as if the bridge's clock were off.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arguments import Vector, Whole
from .sample_clock import NS, RATE_TOLERANCE

# Warming moves a ceramic resonator, and an RC oscillator, by some 50 ppm a minute.
DRIFT_STD_PER_S = 100e-6 / 60
GROUPS, LEAST_IN_GROUP, ITERATIONS = 6, 3, 6
# No working clock is off by more. An emulated bridge runs in a time of its own, which pairs cannot correct.
MAX_RATE_ERROR = 0.03
# Delays scatter by at least the time between two reads of its line by a bridge.
LEAST_SCATTER_S = 20e-6
# A clock restarted if host - bus moves by more than this and what the rate may be off.
LEAP_S = 0.5
ADAPTER_DELAY_S = 0.05
# A silence is longer than both this time and this many usual intervals of pairs. A lost bridge is given up after
# 0.25 s.
SILENCE_S, SILENCE_INTERVALS = 0.2, 4.0
# Pairs kept of a stream of days, and the growth of their number until the next estimate of the rate.
MAX_PAIRS, REFIT_GROWTH = 20_000, 1.1


class ClockFit(NamedTuple):
    """Parabola under the pairs.

    Attributes
    ----------
    b, c : coefficients of the formula above; 1, 1/s. b_std : standard deviation of b.
    first_s, mid_s, last_s : first, middle and last time of the pairs on the bus's clock.
    """

    b: float
    c: float
    b_std: float
    first_s: float
    mid_s: float
    last_s: float

    @property
    def ppm(self) -> float:
        """Rate error of the bus's clock."""
        return (1.0 / (1.0 + self.b) - 1.0) * 1e6

    def slope(self, t_s: Vector | float) -> Vector | float:
        """Return the slope of host - t at `t_s`; beyond the pairs, the slope at their ends."""
        return self.b + 2.0 * self.c * (np.clip(t_s, self.first_s, self.last_s) - self.mid_s)

    def host_s(self, t_s: Vector) -> Vector:
        """Convert times (n,) [s] of the bus's clock to the host's rate; the time of the first pair stays."""
        inside = np.clip(t_s, self.first_s, self.last_s)
        parabola = [self.b * x + self.c * x * x for x in (inside - self.mid_s, self.first_s - self.mid_s)]
        return np.asarray(t_s + parabola[0] - parabola[1] + self.slope(t_s) * (t_s - inside))


class HostClock:
    """Collector of pairs; without any, the bus's clock counts as the host's."""

    def __init__(self) -> None:
        self._bus_ns, self._host_ns = array("q"), array("q")
        self._next = GROUPS * LEAST_IN_GROUP
        self._since_s, self._shown_s, self._slope = 0.0, 0.0, 0.0

    def __bool__(self) -> bool:
        return bool(self._bus_ns)

    def add(self, t_ns: Whole, host_ns: Whole) -> None:
        """Add replies about what happened at `t_ns` (n,) of the bus's clock, which arrived at `host_ns` (n,)."""
        latest = np.concatenate(([self._bus_ns[-1] if self._bus_ns else t_ns[0] - 1], t_ns))
        later = t_ns > np.maximum.accumulate(latest)[:-1]
        self._bus_ns.extend(t_ns[later].tolist())
        self._host_ns.extend(host_ns[later].tolist())
        self._estimate_if_due()

    def _estimate_if_due(self) -> None:
        if len(self._bus_ns) < self._next:
            return
        self._next = int(REFIT_GROWTH * len(self._bus_ns)) + 1
        at_s = self._bus_ns[-1] * NS
        self._shown_s = float(self.provisional_s(at_s))
        self._since_s, self._slope = at_s, float(self.fit().slope(at_s))

    def provisional_s(self, t_s: Vector | float) -> Vector | float:
        """Convert `t_s` to the host's rate as estimated now; a new estimate applies from its own time on."""
        return self._shown_s + (t_s - self._since_s) * (1.0 + self._slope)

    def forget(self) -> None:
        """Forget pairs that are too old for the present rate."""
        if len(self._bus_ns) > MAX_PAIRS:
            del self._bus_ns[: MAX_PAIRS // 2], self._host_ns[: MAX_PAIRS // 2]
            self._next = int(REFIT_GROWTH * len(self._bus_ns)) + 1

    def fit(self) -> ClockFit:
        """Fit the parabola to all pairs; there must be one."""
        return fit_pairs(np.array(self._bus_ns), np.array(self._host_ns))

    def final(self) -> Callable[[Vector], Vector]:
        """Return the function from times (n,) [s] of the bus's clock to the host's rate, by all pairs."""
        return self.fit().host_s if self else lambda t_s: t_s


def fit_pairs(t_ns: Whole, host_ns: Whole) -> ClockFit:
    """Fit the parabola under the times (n,) of the bus and the host."""
    first_s, last_s = int(t_ns[0]) * NS, int(t_ns[-1]) * NS
    mid_ns = (int(t_ns[0]) + int(t_ns[-1])) // 2
    unknown = ClockFit(0.0, 0.0, RATE_TOLERANCE, first_s, mid_ns * NS, last_s)
    ahead_ns = host_ns - t_ns
    groups = [
        (_grouped((t_ns[run] - mid_ns) * NS), _grouped((ahead_ns[run] - ahead_ns[run][0]) * NS))
        for run in _runs(t_ns, ahead_ns)
    ]
    # The median, since a machine that was busy once is no reason.
    if not groups or np.median([_crude_slope(t, ahead) for t, ahead in groups]) > MAX_RATE_ERROR:
        return unknown
    x, H = np.zeros(2), np.eye(2)
    for _ in range(ITERATIONS):
        x, H = _parabola([_least_delayed(t, ahead, x) for t, ahead in groups], x)
    return ClockFit(float(x[0]), float(x[1]), float(np.sqrt(np.linalg.inv(H)[0, 0])), first_s, mid_ns * NS, last_s)


def _runs(t_ns: Whole, ahead_ns: Whole) -> Iterator[slice]:
    """Yield the runs that are long enough, between silences and leaps of one of the clocks."""
    passed, moved = np.diff(t_ns) * NS, np.abs(np.diff(ahead_ns)) * NS
    silent_s = max(SILENCE_S, SILENCE_INTERVALS * float(np.median(passed))) if len(passed) else SILENCE_S
    cuts = np.flatnonzero((passed > silent_s) | (moved > LEAP_S + 2.0 * RATE_TOLERANCE * passed)) + 1
    for first, last in pairwise((0, *cuts.tolist(), len(t_ns))):
        if last - first >= GROUPS * LEAST_IN_GROUP:
            yield slice(first, last)


def _grouped(each: NDArray[np.floating]) -> Vector:
    """Reshape (n,) to (GROUPS, n / GROUPS), without the first few."""
    n = len(each) // GROUPS
    return np.asarray(each[-n * GROUPS :].reshape(GROUPS, n), np.float64)


def _crude_slope(t: Vector, ahead: Vector) -> float:
    """Return the slope from the first group's median to the last's, less what adapters hold back."""
    moved, passed = (float(np.median(each[-1]) - np.median(each[0])) for each in (ahead, t))
    return max(abs(moved) - ADAPTER_DELAY_S, 0.0) / passed


def _least_delayed(t: Vector, ahead: Vector, x: Vector) -> tuple[Vector, Vector, float]:
    """Return time and `ahead` of each group's least delayed pair for (b, c) = x, and the mean spacing."""
    delay = ahead - x[0] * t - x[1] * t * t
    two = np.argpartition(delay, 1, axis=1)[:, :2]
    spacing = float(np.mean(np.diff(np.take_along_axis(delay, two, axis=1), axis=1)))
    at, seen = (np.take_along_axis(each, two[:, :1], axis=1)[:, 0] for each in (t, ahead))
    return at, seen, spacing


def _parabola(least: list[tuple[Vector, Vector, float]], x: Vector) -> tuple[Vector, Vector]:
    """Solve for (b, c) and their information (2, 2); each run's offset is eliminated by its means."""
    H: Vector = np.diag([RATE_TOLERANCE**-2, (0.5 * DRIFT_STD_PER_S) ** -2])
    g = np.zeros(2)
    for at, seen, spacing in least:
        A = np.stack((at, at * at), axis=1)
        A -= A.mean(axis=0)
        ahead = seen - seen.mean()
        scatter = float(np.sqrt(np.sum((ahead - A @ x) ** 2) / (GROUPS - 1)))
        var = LEAST_SCATTER_S**2 + max(spacing, scatter) ** 2
        H += A.T @ A / var
        g += A.T @ ahead / var
    return np.asarray(np.linalg.solve(H, g), np.float64), np.asarray(H, np.float64)
