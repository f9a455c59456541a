"""The sensor's own clock, fitted to the stamps of its samples: what is late, rounded, repeated or missing.

A sensor measures evenly. Over USB, radio or a busy computer its samples arrive late by the delay of the transport: so
within a run without a missing sample one line, with the sample period as its slope, lies below all stamps; after
missing samples, or a logger's pause, the line lies higher. A jump of that lower envelope is therefore a gap, while a
stamp that is merely late is not. With the gaps known, the clock is fitted as a chip's is by polls of its FIFO
(sample_clock.py).

Stamps that are even, or that follow no such line as of a program that measured when it could, are the samples' times;
a longer step between them is a gap, as it is to the estimate and to a driver that polls.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..arguments import Mask, Vector, Whole
from .sample_clock import GAP_INTERVALS, NS, SampleClock, make_increasing

FEWEST = 100
# the lowest sample rate that can be calibrated
SLOWEST_HZ = 5.0
# times of a slow logger may be this many seconds apart; those of any sensor in milliseconds are farther apart
LONGEST_STEP_S = 2.0
# periods: steps that vary by less are a clock's own
MOST_UNEVEN = 0.1
# samples over which a period is measured, so that bursts do not matter, and the least number of such stretches
LAG_SAMPLES, LEAST_STRETCHES = 250, 4
# variance of a step over LAG_SAMPLES samples, relative to that many times the variance of one step: 1 if each step
# varies by itself; below this, late stamps follow a line or come in bursts
MOST_LINE_VARIANCE = 0.2
# shares of steps that are left out as pauses and delays, over LAG_SAMPLES samples and over one
LAG_OUTLIERS, STEP_OUTLIERS = 0.1, 0.02
# s, and the least number of samples, of a stretch, which holds a stamp that was hardly late
STRETCH_S, STRETCH_SAMPLES = 0.25, 48
# stretches within which delayed samples have arrived
CATCH_UP_STRETCHES = 8
# the share of stamps, the earliest ones, to which the clock is fitted
EARLIEST = 0.75
# a jump of the envelope is a gap beyond these multiples of the period, of its usual move and of the stamps' resolution
GAP_PERIODS, GAP_MOVES, GAP_RESOLUTIONS = 0.6, 6.0, 1.5


@dataclass(frozen=True)
class Clock:
    """Times of samples by the sensor's clock.

    Attributes
    ----------
    t : (n,) s. gap : (n,) True where samples before are missing. rate_hz : of the sensor.
    jitter_s : rms of the stamps about the clock; 0 if the stamps are the samples' times.
    interrupted : times [s] of the last samples before the measurement was interrupted.
    """

    t: Vector
    gap: Mask
    rate_hz: float
    jitter_s: float = 0.0
    interrupted: tuple[float, ...] = ()

    @cached_property
    def remark(self) -> str:
        """Return a clause for the user on how the stamps were replaced; empty if they were not."""
        if not self.jitter_s:
            return ""
        lost = int(self.gap.sum())
        gaps = f"with {lost} gap{'s' if lost > 1 else ''}" if lost else "without gaps"
        return (
            f"its times are arrival stamps, {1e3 * self.jitter_s:.2g} ms (rms) off, and were replaced by an even clock"
            f" of {self.rate_hz:.4g} Hz {gaps}"
        )

    def describe(self, name: str) -> str:
        """Return the remark as a sentence on the recording `name`; empty if there is none."""
        return f"{name}: {self.remark}." if self.remark else ""


def are_new(at_once: Mask | None, values: Vector) -> Mask:
    """Return (n,) False where a sample (n, k) repeats the one before, as loggers do beside a faster sensor.

    If many different samples share a stamp, stamps are rounded, and equal samples may be two measurements. Without
    stamps, most samples have to repeat the one before: a sensor at rest may read the same twice.

    Parameters
    ----------
    at_once : (n - 1,) True where a stamp is that of the sample before; None without stamps.
    """
    alike = (values[1:] == values[:-1]).all(axis=1)
    if at_once is None:
        new = len(values) - np.count_nonzero(alike)
        again = alike & (1 < new <= len(values) / 2)
    else:
        again = at_once & alike & (np.count_nonzero(at_once & ~alike) <= np.count_nonzero(at_once & alike))
    return np.append(True, ~again)[: len(values)]


def are_gaps(t: Vector | Whole) -> Mask:
    """Return (n,) True where more than one sample is missing before a sample, by increasing times or numbers (n,)."""
    steps = np.diff(t, prepend=t[:1])
    return steps > GAP_INTERVALS * np.median(steps[1:]) if len(t) > 1 else np.zeros(len(t), bool)


def sample_period(stamps: Vector, number: Whole | None = None) -> float:
    """Return the sample period of (n,) stamps that may come in bursts, repeat or be late, in their unit."""
    # of samples at one stamp, the first: a rounded stamp has just changed
    new = np.flatnonzero(np.diff(stamps, prepend=np.nan) != 0.0)
    if len(new) < 2:
        return 0.0
    lag = max(min(LAG_SAMPLES * len(new) // len(stamps), (len(new) - 1) // LEAST_STRETCHES), 1)
    at, count = stamps[new], new if number is None else number[new]
    return float(np.median((at[lag:] - at[:-lag]) / (count[lag:] - count[:-lag])))


def fit_clock(stamps: Vector, number: Whole | None = None) -> Clock:
    """Return the clock behind (n,) stamps [s] that do not decrease.

    Parameters
    ----------
    number : (n,) of the samples in the order of measurement, with holes where some are known to be missing.
    """
    n = len(stamps)
    number = np.arange(n) if number is None else number
    period, steps = sample_period(stamps, number), np.diff(stamps)
    own = Clock(make_increasing(stamps, MOST_UNEVEN * period), are_gaps(stamps), 1.0 / period if period else 0.0)
    off = steps - period * np.diff(number)
    if n < FEWEST or not period > 0.0 or stamps[-1] - stamps[0] > NS * np.iinfo(np.int64).max / 2:
        return own
    if np.percentile(np.abs(off), 95) <= MOST_UNEVEN * period and off.min() > -period:
        return own
    # several changes of rounded stamps, which have many samples each
    several = LEAST_STRETCHES * n // (int(np.count_nonzero(steps)) + 1)
    gap, late = _gaps(stamps, number, period, several)
    lag = min(max(LAG_SAMPLES, several), n // LEAST_STRETCHES)
    # of rounded stamps, few steps are none
    seldom = min(STEP_OUTLIERS, float(np.mean(steps > 0.0)) / 8)
    over_lag, of_step = _trimmed_square(late[lag:] - late[:-lag], LAG_OUTLIERS), _trimmed_square(off, seldom)
    if over_lag > MOST_LINE_VARIANCE * lag * of_step:
        return own
    clock, segment = SampleClock(1.0 / period), np.cumsum(gap)
    index = number - number[np.maximum.accumulate(np.where(gap, np.arange(n), 0))]
    for first, last in pairwise((0, *np.flatnonzero(gap).tolist(), n)):
        in_time = first + np.flatnonzero(late[first:last] <= np.quantile(late[first:last], EARLIEST))
        clock.begin_segment()
        clock.add(np.rint(stamps[in_time] / NS).astype(np.int64), index[in_time] + 1)
    t, rate_hz = clock.times_s(segment.astype(np.int64), index), clock.rate_hz
    late, edges = stamps - t, _edges(n, period, several)
    least = np.minimum.reduceat(late, edges)
    usual = np.add.reduceat(late, edges) / np.diff(edges, append=n) - least
    if np.median(np.abs(least - np.median(least))) > max(np.median(usual), MOST_UNEVEN * period):
        return own  # the clock errs by more than the stamps are late: single samples are missing here and there
    return Clock(make_increasing(t, MOST_UNEVEN / rate_hz), gap | are_gaps(number), rate_hz, float(np.std(stamps - t)))


def _trimmed_square(values: Vector, left_out: float) -> float:
    """Return the mean square of values without a share of the largest."""
    squares = np.sort(values * values)
    return float(squares[: len(squares) - max(round(left_out * len(squares)), 1)].mean())


def _gaps(stamps: Vector, number: Whole, period: float, least_width: int) -> tuple[Mask, Vector]:
    """Return (n,) where samples are missing, by jumps of the lower envelope, and the delay (n,) of each stamp.

    Parameters
    ----------
    least_width : samples of a stretch of the envelope, at least.
    """
    n, edges = len(stamps), _edges(len(stamps), period, least_width)
    width = int(edges[1])
    late = stamps - period * number
    # after four rounds the envelope's slope has settled, here and below
    for _ in range(4):
        late -= float(np.median(np.diff(np.minimum.reduceat(late, edges)))) / width * number
    lost = GAP_PERIODS * period
    if np.median(np.diff(stamps)) < MOST_UNEVEN * period:
        # the last sample of a burst waits for up to a period; where that wraps, the envelope jumps without a loss
        lost += period
        for _ in range(4):
            moved = np.diff(np.minimum.reduceat(late, edges))
            usual = moved[np.abs(moved) <= lost]
            late -= float(usual.sum()) / max(len(usual), 1) / width * number
    least = np.minimum.reduceat(late, edges)
    chance = float(np.median(np.abs(np.diff(least))))
    # after a mere delay the next samples are soon in time again
    least = sliding_window_view(np.append(least, np.full(CATCH_UP_STRETCHES - 1, np.inf)), CATCH_UP_STRETCHES).min(1)
    moved = np.diff(least)
    limit = max(lost, GAP_MOVES * chance, GAP_RESOLUTIONS * _resolution(stamps))
    gap = np.zeros(n, bool)
    for at in np.flatnonzero(moved > limit):
        # in the stretch with the gap, the envelope is that of the part before it
        first, last = edges[at], min(edges[at + 1] + width, n)
        from_here = np.minimum.accumulate(late[first:last][::-1])[::-1]
        begins = first + 1 + int(np.argmax(from_here[1:] - late[first : last - 1]))
        gap[begins] = True
        late[begins:] -= moved[at]
    return gap, late


def _edges(n: int, period: float, least_width: int) -> Whole:
    """Return where the stretches of n samples begin; all have a width but the last, which may be half of it longer."""
    width = min(max(round(STRETCH_S / period), STRETCH_SAMPLES, least_width), n // 2)
    return np.arange(0, n - width // 2, width)


def _resolution(stamps: Vector) -> float:
    """Return the step that all stamps are multiples of; 0 if there is none."""
    steps = np.diff(stamps)
    least = float(steps[steps > 0.0].min())
    parts = steps / least
    return least if np.abs(parts - np.rint(parts)).max() < MOST_UNEVEN else 0.0
