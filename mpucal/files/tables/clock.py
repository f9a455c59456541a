"""The sensor's own clock, estimated from arrival stamps over USB, radio, or of a busy computer.

A sensor measures evenly, and its samples arrive late by the delay of the transport. So within a run without a missing
sample one line, with the sample period as its slope, lies below all stamps; after missing samples, or a logger's pause,
the line lies higher. A jump of that lower envelope is therefore a gap, while a stamp that is merely late is not. With
the gaps known, the clock is fitted as a chip's is by polls of its FIFO (chip/clock.py).

Stamps that follow no such line are of a program that measured when it could: they are the samples' times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ...chip.clock import SampleClock, make_increasing
from ...data import Mask, Vector
from .units import NS

FEWEST = 100
# periods: steps that vary by less are a clock's own
EVEN = 0.1
# samples over which a period is measured, so that bursts do not matter, and the least number of such stretches
LAG, STRETCHES = 250, 4
# variance of a step over LAG samples, over LAG times that of one step: 1 if each step varies by itself, and far less if
# late stamps follow a line or come in bursts
FOLLOWS_A_LINE = 0.2
# shares of steps that are left out as pauses and delays, over LAG samples and over one
OUTLIERS, SELDOM = 0.1, 0.02
# s, and the least number of samples, of a stretch, which holds a stamp that was hardly late
STRETCH_S, STRETCH = 0.25, 48
# stretches within which delayed samples have arrived
CATCHES_UP = 8
# rounds after which the envelope's slope has settled
ROUNDS = 4
# the share of stamps, the earliest ones, to which the clock is fitted
IN_TIME = 0.75
# periods, and multiples of the envelope's usual move or of the stamps' resolution: a jump by more than all is a gap
LOST, BY_CHANCE, ROUNDED = 0.6, 6.0, 1.5


@dataclass(frozen=True)
class EvenClock:
    """Times by the sensor's clock: t (n,) s; gap (n,) where samples are missing before; rms jitter of the stamps."""

    t: Vector
    gap: Mask
    rate_hz: float
    jitter_s: float

    @property
    def description(self) -> str:
        """Return a remark for the user on how the times were replaced."""
        lost = int(self.gap.sum())
        gaps = f"with {lost} gap{'s' if lost > 1 else ''}" if lost else "without gaps"
        return (
            f"its times are arrival stamps, {1e3 * self.jitter_s:.2g} ms (rms) off, and were replaced by an even clock"
            f" of {self.rate_hz:.4g} Hz {gaps}"
        )


def sample_period(stamps: Vector) -> float:
    """Return the sample period of (n,) stamps that may come in bursts, repeat or be late, in their unit."""
    lag = min(LAG, max((len(stamps) - 1) // STRETCHES, 1))
    return float(np.median(stamps[lag:] - stamps[:-lag])) / lag if len(stamps) > 1 else 0.0


def fit_even_clock(stamps: Vector) -> EvenClock | None:
    """Return the clock behind (n,) stamps [s] that do not decrease; None if the stamps are the samples' times."""
    if len(stamps) < FEWEST or not (period := sample_period(stamps)) > 0.0:
        return None
    off = np.diff(stamps) - period
    if np.percentile(np.abs(off), 95) <= EVEN * period and off.min() > -period:
        return None
    gap, late = _gaps(stamps, period)
    lag = min(LAG, len(stamps) // STRETCHES)
    if _square(late[lag:] - late[:-lag], OUTLIERS) > FOLLOWS_A_LINE * lag * _square(off, SELDOM):
        return None
    clock, segment, index = SampleClock(1.0 / period), np.cumsum(gap), np.empty(len(stamps), np.int64)
    begins: NDArray[np.intp] = np.flatnonzero(np.append(True, gap[1:]))
    for first, last in zip(begins, np.append(begins[1:], len(stamps)), strict=True):
        index[first:last] = np.arange(last - first)
        in_time = first + np.flatnonzero(late[first:last] <= np.quantile(late[first:last], IN_TIME))
        clock.begin_segment()
        clock.add(np.rint(stamps[in_time] * NS).astype(np.int64), index[in_time] + 1)
    t = clock.times_s(segment.astype(np.int64), index)
    late = stamps - t
    rate_hz = clock.rate_hz
    return EvenClock(
        make_increasing(t, EVEN / rate_hz), gap, rate_hz, float(np.sqrt(np.mean((late - late.mean()) ** 2)))
    )


def _square(values: Vector, left_out: float) -> float:
    """Return the mean square of values without a share of the largest."""
    squares = np.sort(values * values)
    return float(squares[: len(squares) - max(round(left_out * len(squares)), 1)].mean())


def _gaps(stamps: Vector, period: float) -> tuple[Mask, Vector]:
    """Return (n,) where samples are missing, by jumps of the lower envelope, and the delay (n,) of each stamp."""
    n = len(stamps)
    width = max(round(STRETCH_S / period), STRETCH)
    edges = np.arange(0, n - width // 2, width)
    late = stamps - period * np.arange(n)
    for _ in range(ROUNDS):
        late -= float(np.median(np.diff(np.minimum.reduceat(late, edges)))) / width * np.arange(n)
    least = np.minimum.reduceat(late, edges)
    chance = float(np.median(np.abs(np.diff(least))))
    # after a mere delay the next samples are soon in time again
    least = sliding_window_view(np.append(least, np.full(CATCHES_UP - 1, np.inf)), CATCHES_UP).min(1)
    moved = np.diff(least)
    limit = max(LOST * period, BY_CHANCE * chance, ROUNDED * _resolution(stamps))
    gap = np.zeros(n, bool)
    for at in np.flatnonzero(moved > limit):
        # in the stretch with the gap, the envelope is that of the part before it
        first, last = edges[at], min(edges[at + 1] + width, n)
        from_here = np.minimum.accumulate(late[first:last][::-1])[::-1]
        begins = first + 1 + int(np.argmax(from_here[1:] - late[first : last - 1]))
        gap[begins] = True
        late[begins:] -= moved[at]
    return gap, late


def _resolution(stamps: Vector) -> float:
    """Return the step that all stamps are multiples of; 0 if there is none."""
    steps = np.diff(stamps)
    least = float(steps[steps > 0.0].min())
    parts = steps / least
    return least if np.abs(parts - np.rint(parts)).max() < EVEN else 0.0
