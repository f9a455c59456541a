"""Sample clock: the time of each sample, by regression of the sample index on the bus's clock.

The chip samples with a clock of its own, up to 1 % off. Only the number of samples that it had taken by the time of
each observation is known. An observation at `taken` samples finds the newest half an interval old on average, so

    taken_j - 1/2 = rate (t_j - t_0),        t_i = t_0 + i / rate,

with one rate for the whole recording and one t_0 for each run of samples without a gap: least squares of
`taken` on t. The data sheet's tolerance is the prior of the rate: it holds the first second's times in
place, and weighs less than 1e-6 after half a minute. A clock whose rate changed is split into several pieces, each
with a rate of its own (piecewise_rate.py), in the final times and not while samples come in.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from operator import mul

import numpy as np

from ..arguments import Vector, Whole
from . import UNIFORM
from .piecewise_rate import fit_lines, merge_equal_slopes

NS = 1e-9
# a time between two samples that is longer than this number of intervals is a gap
GAP_INTERVALS = 2.5
# in a longer time a sample is missing, or its time is late
MISSING_INTERVALS = 1.5

# PS-MPU-6000A r3.4, section 6.6: the PLL on a gyroscope is within 1 %. So is an RC oscillator; a ceramic resonator is
# within 0.5 %.
RATE_TOLERANCE = 0.01
# (n,) s of samples number (n,) of segments (n,)
Times = Callable[[Whole, Whole], Vector]

# Larger than the number of samples in any segment.
SEGMENT_STRIDE = 2.0**40


def poll_phase(n: int) -> float:
    """Return the offset of poll number `n` from its due time, -1/2..1/2 of a sample interval.

    Regular polls would fall at the same phase again and again if their period is a whole number of intervals; a rate
    error of 100 ppm would then stay hidden for a minute.
    """
    # The fractional parts of the golden ratio's multiples lie evenly between 0 and 1.
    return n * (5**0.5 - 1) / 2 % 1 - 0.5


@dataclass
class _Segment:
    """Observations of one run of samples, and sums over them: integers, so that they are exact."""

    origin_ns: int = 0
    n: int = 0
    t: int = 0
    taken: int = 0
    tt: int = 0
    t_taken: int = 0
    observed_ns: array[int] = field(default_factory=lambda: array("q"))
    observed: array[int] = field(default_factory=lambda: array("q"))

    def add(self, t_ns: list[int], taken: list[int]) -> None:
        self.origin_ns = self.origin_ns if self.n else t_ns[0]
        t = [each - self.origin_ns for each in t_ns]
        self.observed_ns.extend(t_ns)
        self.observed.extend(taken)
        self.n += len(t)
        self.t += sum(t)
        self.taken += sum(taken)
        self.tt += sum(map(mul, t, t))
        self.t_taken += sum(map(mul, t, taken))

    @property
    def t_mean_s(self) -> float:
        """Mean time of the observations; NaN without any."""
        return self.origin_ns * NS + self.t / self.n * NS if self.n else math.nan

    @property
    def taken_mean(self) -> float:
        """Mean number of samples taken at the observations; NaN without any."""
        return self.taken / self.n if self.n else math.nan

    @property
    def spread_s2(self) -> float:
        """Sum of (t - mean t)^2."""
        return (self.n * self.tt - self.t * self.t) / self.n * NS * NS if self.n else 0.0

    @property
    def product_s(self) -> float:
        """Sum of (t - mean t)(taken - mean taken)."""
        return (self.n * self.t_taken - self.t * self.taken) / self.n * NS if self.n else 0.0


class SampleClock:
    """Times of samples in seconds of the bus's clock, refined by every observation.

    Parameters
    ----------
    nominal_hz : the rate that the chip was set to.
    """

    def __init__(self, nominal_hz: float) -> None:
        self._nominal_hz = nominal_hz
        self._segments: list[_Segment] = []
        self._forgotten = 0
        self._past_spread_s2 = 0.0
        self._past_product_s = 0.0

    @property
    def segment(self) -> int:
        """Number of the current segment: a run of samples without a gap."""
        return self._forgotten + len(self._segments) - 1

    def begin_segment(self) -> None:
        """Begin a segment with an offset of its own: at the start, and after samples were lost."""
        if self._segments:
            self._past_spread_s2 += self._segments[-1].spread_s2
            self._past_product_s += self._segments[-1].product_s
        self._segments.append(_Segment())

    def forget(self) -> None:
        """Forget all segments except the current one, and the single observations of that."""
        self._forgotten += len(self._segments[:-1])
        self._segments = self._segments[-1:]
        for each in self._segments:
            del each.observed_ns[:], each.observed[:]

    def add(self, t_ns: Whole, taken: Whole) -> None:
        """Add observations: at `t_ns` (n,) the chip had taken `taken` (n,) samples of the current segment."""
        self._segments[-1].add(t_ns.tolist(), taken.tolist())

    @property
    def rate_hz(self) -> float:
        """Sample rate as far as it is known; a segment must have begun."""
        prior = UNIFORM / (RATE_TOLERANCE * self._nominal_hz) ** 2
        spread = self._past_spread_s2 + self._segments[-1].spread_s2
        product = self._past_product_s + self._segments[-1].product_s
        return (product + prior * self._nominal_hz) / (spread + prior)

    def times_s(self, segment: Whole, index: Whole) -> Vector:
        """Return the times (n,) of samples `index` (n,), from 0 in their observed `segment` (n,)."""
        segment = segment - self._forgotten
        t_mean_s = np.array([s.t_mean_s for s in self._segments])
        taken_mean = np.array([s.taken_mean for s in self._segments])
        return np.asarray(t_mean_s[segment] + (index + 0.5 - taken_mean[segment]) / self.rate_hz, np.float64)

    def final(self) -> Times:
        """Return `times_s` by all observations, with a rate for each piece of a clock whose rate changed."""
        pieces = [
            (number, line)
            for number, each in enumerate(self._segments, self._forgotten)
            if each.observed_ns
            for line in fit_lines(np.array(each.observed_ns) * NS, np.array(each.observed, np.float64))
        ]
        rates_hz = merge_equal_slopes([line for _, line in pieces], self._nominal_hz, RATE_TOLERANCE)
        begins = np.array([number * SEGMENT_STRIDE + line.first for number, line in pieces])
        t_s, taken = np.array([(line.t_s, line.y) for _, line in pieces]).reshape(-1, 2).T

        def times_s(segment: Whole, index: Whole) -> Vector:
            at = np.searchsorted(begins, segment * SEGMENT_STRIDE + index, side="right") - 1
            return np.asarray(t_s[at] + (index + 0.5 - taken[at]) / rates_hz[at], np.float64)

        return times_s


def make_increasing(t_s: Vector, step_s: float) -> Vector:
    """Move the times `t_s` (n,) as little as makes each at least `step_s` later than the one before."""
    if not (t_s[1:] - t_s[:-1] < step_s).any():
        return t_s
    ramp = step_s * np.arange(len(t_s))
    return np.asarray(np.maximum.accumulate(t_s - ramp) + ramp, np.float64)


class PolledClock(SampleClock):
    """Times of samples that are read one by one: each observation is the read of one sample, which has its time."""

    def __init__(self, nominal_hz: float) -> None:
        super().__init__(nominal_hz)
        self._past_steps = self._past_ns = 0

    def begin_segment(self) -> None:
        """See SampleClock."""
        self._past_steps, self._past_ns = self._steps_and_time()
        super().begin_segment()

    def forget(self) -> None:
        """Forget all segments except the current one."""
        self._forgotten += len(self._segments[:-1])
        self._segments = self._segments[-1:]

    def is_late(self, t_ns: int) -> bool:
        """Return True if samples were missed before one that is read at `t_ns`; two samples are needed for the rate."""
        reads_ns = self._segments[-1].observed_ns
        known = bool(reads_ns and self._steps_and_time()[0])
        return known and t_ns - reads_ns[-1] > GAP_INTERVALS / self.rate_hz / NS

    @property
    def rate_hz(self) -> float:
        """Samples a second, without the gaps; the nominal ones until there are two."""
        steps, ns = self._steps_and_time()
        return steps / (ns * NS) if ns else self._nominal_hz

    def times_s(self, segment: Whole, index: Whole) -> Vector:
        """Return the times (n,) of samples `index` (n,), from 0 in their `segment` (n,)."""
        places = zip((segment - self._forgotten).tolist(), index.tolist(), strict=True)
        return np.array([self._segments[at].observed_ns[i] for at, i in places]) * NS

    def final(self) -> Times:
        """Return `times_s`: later reads do not improve the times."""
        return self.times_s

    def _steps_and_time(self) -> tuple[int, int]:
        """Return the number of steps from sample to sample so far, and the ns that they took, without the gaps."""
        reads_ns = self._segments[-1].observed_ns if self._segments else ()
        if not reads_ns:
            return self._past_steps, self._past_ns
        return self._past_steps + len(reads_ns) - 1, self._past_ns + reads_ns[-1] - reads_ns[0]
