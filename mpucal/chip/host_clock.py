"""The rate of a bus's clock against the host's, from the times at which the host heard what happened when.

A message is under way for some time, never for less than the line needs: host_i = t_i + a_k + delay_i, delay_i > 0,
with one a_k for each kind k of message, which are of different lengths. So a line lies under the pairs of a kind,
whatever an adapter holds back. Each of a few groups of consecutive pairs gives the one that was least delayed. With
priors of the rate's error and of its drift, the parabolas

    host(t) - t = a_k + b (t - t_m) + c (t - t_m)^2

go through those, b the rate error in the middle of the recording. A group's least delay varies as the distance of its
two least delays does (Renyi's spacings), or as the residuals do where these are larger: in step with an adapter's
bursts, replies that are asked for and frames that come by themselves are each late in another way.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass

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
        self._pairs: dict[str, tuple[array[int], array[int]]] = {}
        self._number, self._next = 0, GROUPS * LEAST_IN_GROUP
        self._since_s, self._shown_s, self._slope = 0.0, 0.0, 0.0

    def __bool__(self) -> bool:
        return bool(self._pairs)

    def saw(self, kind: str, t_ns: int, host_ns: int) -> None:
        """A message of a `kind`, about what happened at `t_ns` of the bus's clock, came in at `host_ns`."""
        times, heard = self._pairs.setdefault(kind, (array("q"), array("q")))
        if times and t_ns <= times[-1]:
            return
        times.append(t_ns)
        heard.append(host_ns)
        self._number += 1
        if self._number >= self._next:
            self._estimate(t_ns)

    def saw_many(self, kind: str, t_ns: NDArray[np.int64], host_ns: NDArray[np.int64]) -> None:
        """The same of (n,) messages, of which one estimate is made at most."""
        times, heard = self._pairs.setdefault(kind, (array("q"), array("q")))
        latest = np.concatenate(([times[-1] if times else t_ns[0] - 1], t_ns))
        later = t_ns > np.maximum.accumulate(latest)[:-1]
        times.extend(t_ns[later].tolist())
        heard.extend(host_ns[later].tolist())
        self._number += int(later.sum())
        if self._number >= self._next:
            self._estimate(times[-1])

    def _estimate(self, t_ns: int) -> None:
        self._next = int(GROWTH * self._number) + 1
        at_s = t_ns * NS
        self._shown_s = float(self.provisional_s(at_s))
        self._since_s, self._slope = at_s, float(self.fit().slope(at_s))

    def provisional_s(self, t_s: Vector | float) -> Vector | float:
        """`t_s` at the host's rate, as known now; each estimate counts from when it was made."""
        return self._shown_s + (t_s - self._since_s) * (1.0 + self._slope)

    def forget(self) -> None:
        """Let go of what is too old to tell the rate now."""
        if self._number > KEPT:
            for times, heard in self._pairs.values():
                del times[: len(times) // 2], heard[: len(heard) // 2]
            self._number = sum(len(times) for times, _ in self._pairs.values())
            self._next = int(GROWTH * self._number) + 1

    def fit(self) -> ClockFit:
        """The parabola under all pairs; there is one at least."""
        return fitted({kind: (np.array(t), np.array(host)) for kind, (t, host) in self._pairs.items()})

    def final(self) -> Callable[[Vector], Vector]:
        """Times (n,) [s] of the bus's clock to times at the host's rate, by all pairs."""
        return self.fit().host_s if self else lambda t_s: t_s


Pairs = tuple[NDArray[np.int64], NDArray[np.int64]]


def fitted(pairs: Mapping[str, Pairs]) -> ClockFit:
    """The parabolas under (n,) times [ns] of the bus and the host, by kind; of their longest run without a leap."""
    kinds = [_longest(*each) for each in pairs.values()]
    kinds.sort(key=lambda each: -len(each[0]))
    t, host = kinds[0]
    first_s, last_s = int(t[0]) * NS, int(t[-1]) * NS
    mid_ns, ahead_ns = (int(t[0]) + int(t[-1])) // 2, int(host[0] - t[0])
    unknown = ClockFit(0.0, 0.0, RATE_STD, first_s, mid_ns * NS, last_s)
    grouped = [_grouped(np.asarray((t - mid_ns) * NS), np.asarray((host - t - ahead_ns) * NS)) for t, host in kinds]
    groups = [each for each in grouped if each is not None]
    if not groups or any(_crude_slope(t, ahead) > MOST for t, ahead in groups):
        return unknown
    x, H = np.zeros(2), np.eye(2)
    for _ in range(ROUNDS):
        x, H = _parabola([_least(t, ahead, x) for t, ahead in groups], x)
    return ClockFit(float(x[0]), float(x[1]), float(np.sqrt(np.linalg.inv(H)[0, 0])), first_s, mid_ns * NS, last_s)


def _longest(t_ns: NDArray[np.int64], host_ns: NDArray[np.int64]) -> Pairs:
    ahead, passed = np.diff(host_ns - t_ns) * NS, np.diff(t_ns) * NS
    cuts = np.flatnonzero(np.abs(ahead) > LEAP_S + 2.0 * RATE_STD * passed) + 1
    edges = np.concatenate(([0], cuts, [len(t_ns)]))
    longest = int(np.argmax(np.diff(edges)))
    part = slice(edges[longest], edges[longest + 1])
    return t_ns[part], host_ns[part]


def _grouped(t: Vector, ahead: Vector) -> tuple[Vector, Vector] | None:
    """Both as (GROUPS, n), the first few left out; None of too few."""
    n = len(t) // GROUPS
    if n < LEAST_IN_GROUP:
        return None
    return t[-n * GROUPS :].reshape(GROUPS, n), ahead[-n * GROUPS :].reshape(GROUPS, n)


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
    """(b, c) and their information (2, 2); each kind's offset is eliminated by its means."""
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
