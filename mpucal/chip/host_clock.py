"""The rate of a bus's clock against the host's, from the times at which the host heard what happened when.

A reply is under way for some time, never for less than the line needs: host_i = t_i + a + delay_i, delay_i > 0. So a
line lies under the pairs, whatever an adapter holds back. Each of a few groups of consecutive pairs gives the one that
was least delayed. With priors of the rate's error and of its drift, the parabola

    host(t) - t = a_k + b (t - t_m) + c (t - t_m)^2

goes through those, b the rate error in the middle of the recording, with an a_k for each run k of pairs: one ends
where a clock began anew, and where the bus was silent, since a bridge may have been reset then. A group's least delay
varies as the distance of its two least delays does (Renyi's spacings), or as the residuals do where these are larger.

Of use are replies alone, and of those what is asked for at times that are in step with nothing: what comes by itself
does so at the chip's rate, and goes through an adapter's bursts later and later, as if the bridge's clock were off.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..data import Vector

NS = 1e-9

# A ceramic resonator is within 0.5 %, and RC oscillators within 1 %; warming moves either by some 50 ppm a minute.
RATE_STD, DRIFT_STD_PER_S = 0.01, 100e-6 / 60
GROUPS, LEAST_IN_GROUP, ROUNDS = 6, 3, 6
# No clock that works is off by more: a bridge that is emulated runs in a time of its own, of which pairs say nothing.
MOST = 0.03
# what no line's delay is steadier by: a bridge looks once in so long
STEADY_S = 20e-6
# One of the clocks began anew where host - bus moves by more, beside what the rate may be off.
LEAP_S = 0.5
HELD_BACK_S = 0.05
# what is silence, and in usual distances of pairs; a bridge that was lost is given up after 0.25 s
SILENT_S, SILENT = 0.2, 4.0
# pairs that a stream of days keeps, and by how much their number grows until the rate is estimated again
KEPT, GROWTH = 20_000, 1.1


@dataclass(frozen=True)
class ClockFit:
    """The parabola.

    Attributes
    ----------
    b, c : of the formula above; 1, 1/s. b_std : of b. first_s, mid_s, last_s : of the pairs, the bus's clock.
    """

    b: float
    c: float
    b_std: float
    first_s: float
    mid_s: float
    last_s: float

    @property
    def ppm(self) -> float:
        """How fast the bus's clock runs."""
        return (1.0 / (1.0 + self.b) - 1.0) * 1e6

    def slope(self, t_s: Vector | float) -> Vector | float:
        """Of host - t at `t_s`; beyond the pairs that of their ends."""
        return self.b + 2.0 * self.c * (np.clip(t_s, self.first_s, self.last_s) - self.mid_s)

    def host_s(self, t_s: Vector) -> Vector:
        """(n,) s of the host's rate for (n,) s of the bus's clock, the same at the first pair."""
        inside = np.clip(t_s, self.first_s, self.last_s)
        parabola = [self.b * x + self.c * x * x for x in (inside - self.mid_s, self.first_s - self.mid_s)]
        return np.asarray(t_s + parabola[0] - parabola[1] + self.slope(t_s) * (t_s - inside))


class HostClock:
    """Gathers pairs; without any, the bus's clock is taken to be the host's."""

    def __init__(self) -> None:
        self._times, self._heard = array("q"), array("q")
        self._next = GROUPS * LEAST_IN_GROUP
        self._since_s, self._shown_s, self._slope = 0.0, 0.0, 0.0

    def __bool__(self) -> bool:
        return bool(self._times)

    def add(self, t_ns: int, host_ns: int) -> None:
        """A reply about what happened at `t_ns` of the bus's clock came in at `host_ns`."""
        if self._times and t_ns <= self._times[-1]:
            return
        self._times.append(t_ns)
        self._heard.append(host_ns)
        self._estimate_if_due()

    def add_many(self, t_ns: NDArray[np.int64], host_ns: NDArray[np.int64]) -> None:
        """The same of (n,) replies, of which one estimate is made at most."""
        latest = np.concatenate(([self._times[-1] if self._times else t_ns[0] - 1], t_ns))
        later = t_ns > np.maximum.accumulate(latest)[:-1]
        self._times.extend(t_ns[later].tolist())
        self._heard.extend(host_ns[later].tolist())
        self._estimate_if_due()

    def _estimate_if_due(self) -> None:
        if len(self._times) < self._next:
            return
        self._next = int(GROWTH * len(self._times)) + 1
        at_s = self._times[-1] * NS
        self._shown_s = float(self.provisional_s(at_s))
        self._since_s, self._slope = at_s, float(self.fit().slope(at_s))

    def provisional_s(self, t_s: Vector | float) -> Vector | float:
        """`t_s` at the host's rate, as known now; each estimate counts from when it was made."""
        return self._shown_s + (t_s - self._since_s) * (1.0 + self._slope)

    def forget(self) -> None:
        """Let go of what is too old to tell the rate now."""
        if len(self._times) > KEPT:
            del self._times[: KEPT // 2], self._heard[: KEPT // 2]
            self._next = int(GROWTH * len(self._times)) + 1

    def fit(self) -> ClockFit:
        """The parabola under all pairs; there is one at least."""
        return fit_pairs(np.array(self._times), np.array(self._heard))

    def final(self) -> Callable[[Vector], Vector]:
        """Times (n,) [s] of the bus's clock to times at the host's rate, by all pairs."""
        return self.fit().host_s if self else lambda t_s: t_s


def fit_pairs(t_ns: NDArray[np.int64], host_ns: NDArray[np.int64]) -> ClockFit:
    """The parabola under (n,) times of the bus and the host."""
    first_s, last_s = int(t_ns[0]) * NS, int(t_ns[-1]) * NS
    mid_ns = (int(t_ns[0]) + int(t_ns[-1])) // 2
    unknown = ClockFit(0.0, 0.0, RATE_STD, first_s, mid_ns * NS, last_s)
    ahead_ns = host_ns - t_ns
    groups = [
        (_grouped((t_ns[run] - mid_ns) * NS), _grouped((ahead_ns[run] - ahead_ns[run][0]) * NS))
        for run in _runs(t_ns, ahead_ns)
    ]
    # a machine that was busy once is no reason
    if not groups or np.median([_crude_slope(t, ahead) for t, ahead in groups]) > MOST:
        return unknown
    x, H = np.zeros(2), np.eye(2)
    for _ in range(ROUNDS):
        x, H = _parabola([_least(t, ahead, x) for t, ahead in groups], x)
    return ClockFit(float(x[0]), float(x[1]), float(np.sqrt(np.linalg.inv(H)[0, 0])), first_s, mid_ns * NS, last_s)


def _runs(t_ns: NDArray[np.int64], ahead_ns: NDArray[np.int64]) -> Iterator[slice]:
    """Those that are long enough, between silences and leaps of one of the clocks."""
    passed, moved = np.diff(t_ns) * NS, np.abs(np.diff(ahead_ns)) * NS
    silent_s = max(SILENT_S, SILENT * float(np.median(passed))) if len(passed) else SILENT_S
    cuts = np.flatnonzero((passed > silent_s) | (moved > LEAP_S + 2.0 * RATE_STD * passed)) + 1
    for first, last in pairwise((0, *cuts.tolist(), len(t_ns))):
        if last - first >= GROUPS * LEAST_IN_GROUP:
            yield slice(first, last)


def _grouped(each: NDArray[np.floating]) -> Vector:
    """(n,) as (GROUPS, n / GROUPS), the first few left out."""
    n = len(each) // GROUPS
    return np.asarray(each[-n * GROUPS :].reshape(GROUPS, n), np.float64)


def _crude_slope(t: Vector, ahead: Vector) -> float:
    """From the first group's median to the last's, beside what adapters hold back."""
    moved, passed = (float(np.median(each[-1]) - np.median(each[0])) for each in (ahead, t))
    return max(abs(moved) - HELD_BACK_S, 0.0) / passed


def _least(t: Vector, ahead: Vector, x: Vector) -> tuple[Vector, Vector, float]:
    """Of each group the time and `ahead` of the pair that was least delayed by (b, c) = x; the mean spacing."""
    delay = ahead - x[0] * t - x[1] * t * t
    two = np.argpartition(delay, 1, axis=1)[:, :2]
    spacing = float(np.mean(np.diff(np.take_along_axis(delay, two, axis=1), axis=1)))
    at, seen = (np.take_along_axis(each, two[:, :1], axis=1)[:, 0] for each in (t, ahead))
    return at, seen, spacing


def _parabola(least: list[tuple[Vector, Vector, float]], x: Vector) -> tuple[Vector, Vector]:
    """(b, c) and their information (2, 2); each run's offset is eliminated by its means."""
    H: Vector = np.diag([RATE_STD**-2, (0.5 * DRIFT_STD_PER_S) ** -2])
    g = np.zeros(2)
    for at, seen, spacing in least:
        A = np.stack((at, at * at), axis=1)
        A -= A.mean(axis=0)
        ahead = seen - seen.mean()
        scatter = float(np.sqrt(np.sum((ahead - A @ x) ** 2) / (GROUPS - 1)))
        var = STEADY_S**2 + max(spacing, scatter) ** 2
        H += A.T @ A / var
        g += A.T @ ahead / var
    return np.asarray(np.linalg.solve(H, g), np.float64), np.asarray(H, np.float64)
