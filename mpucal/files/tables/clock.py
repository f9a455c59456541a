"""The sensor's own clock behind stamps of arrival: by USB, by radio, or of a busy computer.

A sensor measures evenly, and its samples arrive late by what the way holds back. So one line with the slope of a
sample's period lies below all stamps of a run in which none is missing; where samples are missing, or a logger
stopped, the next run lies later. A jump of that lower envelope is therefore a gap, and a stamp that is merely late is
none. With gaps known, the times are those that a chip's clock has by the looks at its FIFO (chip/clock.py).

Stamps that keep no such line are of a program that measured when it could: they are the samples' times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ...chip.clock import SampleClock, make_increasing
from ...data import Mask, Vector

NS = 1_000_000_000
FEWEST = 100
# of a period: steps that vary by less are a clock's own
EVEN = 0.1
# samples over which a period is told, whatever arrives at once, and how many such stretches there are at least
LAG, STRETCHES = 250, 4
# In variance a step over LAG samples exceeds that over one as often where each step varies by itself; late stamps keep
# to their line, and bursts of m samples give m / 6.
KEEPS_TO_A_LINE = 0.2
# shares of such steps that pauses and delays may have made, over LAG samples and over one
OUTLIERS, SELDOM = 0.1, 0.02
# s, of stretches of which each has a stamp that was hardly late; and samples of one at least
STRETCH_S, STRETCH = 0.25, 16
# after so many the envelope's slope has settled
ROUNDS = 4
# the share of stamps that the clock is told by
IN_TIME = 0.75
# stretches within which what was held back has arrived
CATCHES_UP = 8
# of a period, and of what envelopes move by: a jump by more is a gap
LOST, BY_CHANCE = 0.6, 6.0
# of what stamps are rounded to
ROUNDED = 1.5
# the least step between two times, in periods: where a run began too late beside the one before
LEAST_STEP = 0.2


@dataclass(frozen=True)
class Even:
    """Times by the sensor's clock: t (n,) s; gap (n,) where samples are missing before; the stamps' jitter [s]."""

    t: Vector
    gap: Mask
    rate_hz: float
    jitter_s: float

    @property
    def said(self) -> str:
        """What was done, in words."""
        lost = int(self.gap.sum())
        gaps = f", with {lost} gap{'s' if lost > 1 else ''}" if lost else ", and none is missing"
        return (
            f"the times are stamps of arrival, {1e3 * self.jitter_s:.2g} ms (rms) about an even {self.rate_hz:.4g} Hz,"
            f" which was taken{gaps}"
        )


def period_of(stamps: Vector) -> float:
    """The samples' period by (n,) stamps that may come in bursts, repeat or be late; in their unit."""
    lag = min(LAG, max((len(stamps) - 1) // STRETCHES, 1))
    return float(np.median(stamps[lag:] - stamps[:-lag])) / lag if len(stamps) > 1 else 0.0


def even(stamps: Vector) -> Even | None:
    """The clock behind (n,) stamps [s], which do not decrease; None where the stamps are the samples' times."""
    if len(stamps) < FEWEST or not (period := period_of(stamps)) > 0.0:
        return None
    off = np.diff(stamps) - period
    if np.percentile(np.abs(off), 95) <= EVEN * period and off.min() > -period:
        return None
    gap, late = _gaps(stamps, period)
    lag = min(LAG, len(stamps) // STRETCHES)
    if _square(late[lag:] - late[:-lag], OUTLIERS) > KEEPS_TO_A_LINE * lag * _square(off, SELDOM):
        return None
    clock, segment, index = SampleClock(1.0 / period), np.cumsum(gap), np.empty(len(stamps), np.int64)
    begins: NDArray[np.intp] = np.flatnonzero(np.append(True, gap[1:]))
    for first, last in zip(begins, np.append(begins[1:], len(stamps)), strict=True):
        index[first:last] = np.arange(last - first)
        in_time = first + np.flatnonzero(late[first:last] <= np.quantile(late[first:last], IN_TIME))
        clock.begin_segment()
        clock.add_many(np.rint(stamps[in_time] * NS).astype(np.int64), index[in_time] + 1)
    t = clock.times_s(segment.astype(np.int64), index)
    late = stamps - t
    rate_hz = clock.rate_hz
    return Even(
        make_increasing(t, LEAST_STEP / rate_hz), gap, rate_hz, float(np.sqrt(np.mean((late - late.mean()) ** 2)))
    )


def _square(values: Vector, left_out: float) -> float:
    """The mean square of values, but for a share of the largest."""
    squares = np.sort(values * values)
    return float(squares[: len(squares) - max(round(left_out * len(squares)), 1)].mean())


def _gaps(stamps: Vector, period: float) -> tuple[Mask, Vector]:
    """(n,) where samples are missing, by the jumps of the stamps' lower envelope; how late each is without them."""
    n = len(stamps)
    width = max(round(STRETCH_S / period), STRETCH)
    edges = np.arange(0, n - width // 2, width)
    late = stamps - period * np.arange(n)
    for _ in range(ROUNDS):
        late -= float(np.median(np.diff(np.minimum.reduceat(late, edges)))) / width * np.arange(n)
    least = np.minimum.reduceat(late, edges)
    chance = float(np.median(np.abs(np.diff(least))))
    # what was only held back arrives in time again soon
    least = sliding_window_view(np.append(least, np.full(CATCHES_UP - 1, np.inf)), CATCHES_UP).min(1)
    moved = np.diff(least)
    limit = max(LOST * period, BY_CHANCE * chance, ROUNDED * _resolution(stamps))
    gap = np.zeros(n, bool)
    for at in np.flatnonzero(moved > limit):
        # the envelope of the stretch in which they are missing is that of its part before
        first, last = edges[at], min(edges[at + 1] + width, n)
        from_here = np.minimum.accumulate(late[first:last][::-1])[::-1]
        begins = first + 1 + int(np.argmax(from_here[1:] - late[first : last - 1]))
        gap[begins] = True
        late[begins:] -= moved[at]
    return gap, late


def _resolution(stamps: Vector) -> float:
    """What all stamps are multiples of, as far as their steps show; 0 where that is less than some of a step."""
    steps = np.diff(stamps)
    least = float(steps[steps > 0.0].min())
    parts = steps / least
    return least if np.abs(parts - np.rint(parts)).max() < EVEN else 0.0
