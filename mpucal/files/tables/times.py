"""Samples of one sensor with their times, and the times of two sensors as those of one recording, in seconds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property

import numpy as np

from ...clocks import S
from ...clocks.stamps import FEWEST, SLOWEST_HZ, Clock, are_gaps, fit_clock, sample_period
from ...data import Mask, Vector, Whole
from ...errors import RecordingError
from ..hints import Hints
from . import shown_units as units
from .units import DAYS, QUANTITIES, resolve_unit

# s between two files, or parts of one, without a common clock: longer than the gaps that a bus leaves
GAP_S = 15.0
# s by which times go back where a logger restarted; a sample that was merely delayed is less late
RESTART_S = 1.0
# of counters of ms or us in a microcontroller, and the most usual steps from before an overflow to after it
COUNTER_BITS, OVERFLOW_STEPS = (16, 32), 100.0
# ns since 1970 of the years 2001 and 2100: other times are not times of day, but count from a start
UTC_NS = (10**18, 41 * 10**17)
_NS_OF = {unit: round(s * S) for unit, s in QUANTITIES["t"].items()}


@dataclass(frozen=True)
class Stream:
    """The samples of one sensor as they stand in a file.

    Attributes
    ----------
    ticks : (n,) times since `origin`, the first of them; None if the file has none.
    values : (n, 3), NaN where a number is missing.
    time_unit, unit : as the file names them; empty if it does not.
    zero_ns : the time of day at time 0, in ns since 1970, if another file tells it.
    places : (n,) of the samples in the order of measurement, with holes where lines without a sample are between.
    temperature_c : (n,), if the file has it. lost : number of lines that hold no sample and no time.
    rate_hz : the sample rate, if the file states it.
    whole_unit : of whole numbers that seem to be in mg or mrad/s, but may be a BNO055's; empty if they are not.
    of_increments : the values are increments over a sample. summed : the file has the steps between times.
    """

    ticks: Vector | None
    values: Vector
    origin: Decimal = Decimal(0)
    time_unit: str = ""
    unit: str = ""
    zero_ns: int | None = None
    places: Whole | None = None
    temperature_c: Vector | None = None
    lost: int = 0
    rate_hz: float | None = None
    whole_unit: str = ""
    of_increments: bool = False
    summed: bool = False

    @cached_property
    def number(self) -> Whole:
        """Return `places`, or else numbers without holes."""
        return np.arange(len(self.values)) if self.places is None else self.places

    @cached_property
    def complete(self) -> Mask:
        """Return (n,) True where a sample has all its numbers."""
        return np.asarray(np.isfinite(self.values).all(axis=1))

    def part(self, mask: Mask) -> Stream:
        """Return the samples where `mask` (n,) is True; with times, the others are repeated ones, and take no time."""
        if mask.all():
            return self
        ticks, number, warm = self.ticks, self.number, self.temperature_c
        if ticks is not None:
            ticks, number = ticks[mask], number - np.cumsum(~mask)
        warm = None if warm is None else warm[mask]
        return replace(self, ticks=ticks, values=self.values[mask], places=number[mask], temperature_c=warm)

    @property
    def at_once(self) -> Mask | None:
        """Return (n - 1,) True where a sample has the time of the one before; None without times."""
        return None if self.ticks is None else self.ticks[1:] == self.ticks[:-1]


def utc_ns(stream: Stream, of_t: str) -> int | None:
    """Return the time of day of the first sample, ns since 1970; None if its time is not one."""
    unit = of_t.removeprefix("times in ").partition(",")[0]
    if stream.ticks is None or unit not in QUANTITIES["t"] or unit == DAYS:
        return None
    return plausible_utc_ns(round(stream.origin * round(QUANTITIES["t"][unit] * S)) + (stream.zero_ns or 0))


def plausible_utc_ns(ns: int) -> int | None:
    """Return a time of day [ns since 1970]; None if no recording can be of it."""
    return ns if UTC_NS[0] < ns < UTC_NS[1] else None


def to_seconds(stream: Stream, first: Stream, hints: Hints, name: str) -> tuple[Clock, str]:
    """Return the clock [s] since the times of `first` begin, and how they were read.

    Raises
    ------
    RecordingError : the unit is not known, or times are not finite or decrease.
    """
    if stream.ticks is None or first.ticks is None:
        rate_hz = hints.rate_hz or units.ANY_HZ
        return Clock(stream.number / rate_hz, are_gaps(stream.number), rate_hz), f"a rate of {rate_hz:g} Hz"
    if not (np.abs(stream.ticks) < units.LARGEST_NUMBER**2).all():
        raise RecordingError(f"{name} holds times that are not finite", "leave those lines out")
    ticks, wraps = _unwrap(stream.ticks + float(stream.origin - first.origin), float(first.origin))
    step, named = sample_period(ticks), hints.units.get("t", stream.time_unit)
    # milliseconds are whole numbers: a fraction of them is a slow recording's second
    slow = "s" if step > 1 / SLOWEST_HZ and (ticks != np.rint(ticks)).any() else ""
    seen = hints.units.get("t", units.time_unit(step, named or _unit_of_date(stream.origin) or slow))
    unit = resolve_unit(name, "t", named, seen, f"the step of {step:g}", likely=step > 0.0)
    t, how = ticks * QUANTITIES["t"][unit], f"times in {unit}"
    back, (on, begins) = np.flatnonzero(np.diff(t) < 0) + 1, go_on(t)
    restarts = np.flatnonzero(begins)
    alike = stream.origin == first.origin and np.array_equal(stream.ticks, first.ticks)
    if len(back) * FEWEST > len(t) or (len(restarts) and not alike):
        at = int(back[0])
        raise RecordingError(
            f"{name}: time does not increase at sample {at} ({t[at - 1]:.6f} s, then {t[at]:.6f} s)",
            "sort the samples by time, or leave out the times with --columns, and give --rate HZ",
        )
    how += ", summed from the steps between samples" if stream.summed else ""
    how += f", which restart {how_often(len(restarts))}" if len(restarts) else ""
    how += f", whose counter overflows {how_often(wraps)}" if wraps else ""
    on = in_order(on, stream.number)
    parts = np.split(np.arange(len(on)), restarts)
    return join_clocks([fit_clock(on[part], stream.number[part]) for part in parts]), how


def go_on(t: Vector, last: float = -math.inf) -> tuple[Vector, Mask]:
    """Return times (n,) that continue after a gap where they restart, and True where they do.

    Parameters
    ----------
    last : the time before the first of them.
    """
    steps = np.diff(t, prepend=last)
    # after a single damaged time, the next goes on
    begins = np.asarray((steps < -RESTART_S) & (np.append(t[1:], -math.inf) < t - steps))
    return t + np.cumsum(np.where(begins, GAP_S - steps, 0.0)), begins


def in_order(t: Vector, number: Whole, last: float = -math.inf) -> Vector:
    """Return times (n,) of samples with these numbers, of which those that came late lie between their neighbours'.

    The same holds where a clock was set back a little. `last` is the time before the first of them.
    """
    kept = t >= np.maximum.accumulate(np.maximum(t, last))
    return np.interp(number, number[kept], t[kept]) if kept.any() else np.full(len(t), last)


def how_often(count: int) -> str:
    """Return a count as an adverb."""
    return "once" if count == 1 else f"{count} times"


def join_clocks(clocks: Sequence[Clock]) -> Clock:
    """Return the clocks of parts, of which each follows the one before, as one that was interrupted between two."""
    t, gap = (np.concatenate([getattr(clock, of) for clock in clocks]) for of in ("t", "gap"))
    counts = [len(clock.t) for clock in clocks]
    begins = np.cumsum(counts)[:-1]
    gap[begins] = True
    jitter_s = math.sqrt(np.average([clock.jitter_s**2 for clock in clocks], weights=counts))
    return Clock(t, gap, clocks[int(np.argmax(counts))].rate_hz, jitter_s, tuple(t[begins - 1].tolist()))


def _unit_of_date(origin: Decimal) -> str:
    """Return the unit in which a first time is a time of day, since 1970; empty if it is none."""
    units_of_dates = (unit for unit in ("s", "ms", "us", "ns") if plausible_utc_ns(int(origin * _NS_OF[unit])))
    return next(units_of_dates, "")


def _unwrap(ticks: Vector, origin: float) -> tuple[Vector, int]:
    """Return times (n,) of which a counter of COUNTER_BITS overflowed as if it had not, and how often it did.

    Times count from `origin`. A counter goes on at its lowest number, which is not that of times of day.
    """
    steps, after = np.diff(ticks), ticks[1:] + origin
    most = OVERFLOW_STEPS * float(np.median(np.abs(steps))) if len(steps) else 0.0
    for size in (2.0**bits for bits in COUNTER_BITS):
        begins = [(after >= lowest) & (after <= lowest + most) for lowest in (0.0, -size / 2)]
        over = (steps < 0.0) & (steps + size >= 0.0) & (steps + size <= most) & np.any(begins, axis=0)
        if over.any():
            return ticks + size * np.append(0, np.cumsum(over)), int(over.sum())
    return ticks, 0


def interpolate_rates(
    t: Vector, clock: Clock, rates: Vector, complete: Mask, name: str
) -> tuple[slice, Vector, Mask, str]:
    """Return the accelerations within the rates' time, the rates at their times, gaps there, and a remark.

    Parameters
    ----------
    t : times of accelerations [s]. clock : of the rates (n, 3), of which `complete` (n,) have all numbers.

    Raises
    ------
    RecordingError : the two do not overlap in time.
    """
    t_gyr, rates = clock.t[complete], rates[complete]
    first, last = np.searchsorted(t, t_gyr[0], "left"), np.searchsorted(t, t_gyr[-1], "right")
    if last - first < 2:
        raise RecordingError(
            f"{name}: accelerometer and gyroscope were not recorded at the same time"
            f" (from {t[0]:.3f} to {t[-1]:.3f} s and from {t_gyr[0]:.3f} to {t_gyr[-1]:.3f} s)",
            "give the two tables of one recording",
        )
    kept = slice(int(first), int(last))
    at = t[kept]
    values = np.column_stack([np.interp(at, t_gyr, axis) for axis in rates.T])
    after = np.clip(np.searchsorted(t_gyr, at), 1, len(t_gyr) - 1)
    gap = are_gaps(np.flatnonzero(complete)) | clock.gap[complete]
    nearest = np.minimum(np.abs(at - t_gyr[after - 1]), np.abs(t_gyr[after] - at))
    remark = (
        f"the rates were interpolated to the times of the accelerations, from which their own lie"
        f" {1e3 * float(np.median(nearest)):.2f} ms apart in the median (the gyroscope begins"
        f" {1e3 * (t_gyr[0] - t[0]):+.2f} ms after the accelerometer)"
    )
    return kept, values, gap[after], remark
