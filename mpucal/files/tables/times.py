"""Samples of one sensor with their times, and the times of two sensors as those of one recording, in seconds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import compress, pairwise
from types import EllipsisType
from typing import Any

import numpy as np

from ...data import Mask, Vector
from ...errors import RecordingError
from ..hints import Hints
from . import units
from .clock import fit_even_clock, sample_period
from .names import Times
from .units import NS, QUANTITIES, resolve_unit

# periods: over a longer pause of the rates nothing is interpolated
LOST_PERIODS = 3.5
# ns since 1970 of the years 2001 and 2100: other times are not times of day, but count from a start
UTC_NS = (10**18, 41 * 10**17)


@dataclass(frozen=True)
class Stream:
    """The samples of one sensor as they stand in a file.

    Attributes
    ----------
    times : (n,) exact: decimals, integers or floats; None if the file has none.
    values : (n, 3). time_unit, unit : as the file names them; empty if it does not.
    zero_ns : the time of day at time 0, in ns since 1970, if another file tells it.
    kept : mask of the file's lines that are its samples. lost : number of the other lines that are a loss.
    gap : (n,) True where lines before a sample are missing that only the file shows; None if none is.
    """

    times: Times | None
    values: Vector
    time_unit: str = ""
    unit: str = ""
    zero_ns: int | None = None
    kept: Mask | EllipsisType = ...
    lost: int = 0
    gap: Mask | None = None

    def part(self, mask: Mask) -> Stream:
        """Return the samples where `mask` (n,) is True."""
        times = self.times
        if times is not None:
            times = times[mask] if isinstance(times, np.ndarray) else list(compress(times, mask))
        gap = None if self.gap is None else self.gap[mask]
        kept = np.ones(len(mask), bool) if self.kept is ... else np.array(self.kept)
        kept[kept] = mask
        return replace(self, times=times, values=self.values[mask], gap=gap, kept=kept)

    @property
    def is_new(self) -> Mask:
        """Return (n,) False where a sample repeats the one before, as loggers do beside a faster sensor.

        If many different samples share a time, times are rounded, and equal samples may be two measurements.
        """
        again = np.zeros(len(self.values), bool)
        if self.times is not None and len(again):
            at_once = np.array([b == a for a, b in pairwise(self.times)], bool)
            alike = (self.values[1:] == self.values[:-1]).all(axis=1)
            again[1:] = at_once & alike & (np.count_nonzero(at_once & ~alike) <= np.count_nonzero(at_once & alike))
        return ~again


def utc_ns(stream: Stream, of_t: str) -> int | None:
    """Return the time of day of the first sample, ns since 1970; None if its time is not one."""
    unit = of_t.removeprefix("times in ")
    if stream.times is None or unit not in QUANTITIES["t"]:
        return None
    first = round(Decimal(str(stream.times[0])) * round(QUANTITIES["t"][unit] * NS)) + (stream.zero_ns or 0)
    return plausible_utc_ns(first)


def plausible_utc_ns(ns: int) -> int | None:
    """Return a time of day [ns since 1970]; None if no recording can be of it."""
    return ns if UTC_NS[0] < ns < UTC_NS[1] else None


def to_seconds(stream: Stream, first: Stream, hints: Hints, name: str) -> tuple[Vector, Mask, str, str]:
    """Return times (n,) [s] since those of `first` begin, gaps (n,), how they were read, and a remark on the clock.

    Raises
    ------
    RecordingError : the unit is not known, or times are not finite or decrease.
    """
    none = np.zeros(len(stream.values), bool)
    if stream.times is None or first.times is None:
        rate_hz = hints.rate_hz or units.ANY_HZ
        places = np.flatnonzero(np.ones(len(stream.values), bool) if stream.kept is ... else stream.kept)
        # without times, only the lines show where samples are missing
        return places / rate_hz, none if stream.gap is None else stream.gap, f"a rate of {rate_hz:g} Hz", ""
    ticks = _since(stream.times, first.times[0])
    if not (np.abs(ticks) < units.BEYOND**2).all():
        raise RecordingError(f"{name} holds times that are not finite", "leave those lines out")
    step, said = sample_period(ticks), hints.units.get("t", stream.time_unit)
    # milliseconds are whole numbers: a fraction of them is a slow recording's second
    slow = "s" if step > 1 / units.SLOWEST_HZ and (ticks != np.rint(ticks)).any() else ""
    seen = hints.units.get("t", units.time_unit(step, said or slow))
    unit = resolve_unit(name, "t", said, seen, f"the step of {step:g}")
    t = ticks * QUANTITIES["t"][unit]
    back = np.diff(t) < 0
    if back.any():
        at = int(back.argmax()) + 1
        raise RecordingError(
            f"{name}: time does not increase at sample {at} ({t[at - 1]:.6f} s, then {t[at]:.6f} s)",
            "sort the samples by time, or leave out the times with --columns, and give --rate HZ",
        )
    clock = fit_even_clock(t)
    if clock is not None:
        return clock.t, clock.gap, f"times in {unit}", clock.description
    return t, none, f"times in {unit}", ""


def _since(times: Times, origin: Any) -> Vector:
    """Return times (n,) since `origin` as floats."""
    if isinstance(times, np.ndarray):
        # to_seconds refuses infinite times
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(times - origin, float)
    return np.array([float(time - origin) for time in times])


def interpolate_rates(t: Vector, t_gyr: Vector, rates: Vector, gap: Mask, name: str) -> tuple[slice, Vector, Mask, str]:
    """Return the accelerations within the rates' time, the rates at their times, gaps there, and a remark.

    Parameters
    ----------
    t, t_gyr : times of accelerations and rates [s]. rates : (n, 3). gap : (n,) True where rates before are missing.

    Raises
    ------
    RecordingError : the two do not overlap in time.
    """
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
    apart = t_gyr[after] - t_gyr[after - 1]
    lost = (apart > LOST_PERIODS * float(np.median(np.diff(t_gyr)))) | gap[after]
    nearest = np.minimum(np.abs(at - t_gyr[after - 1]), np.abs(t_gyr[after] - at))
    said = (
        f"the rates were interpolated to the times of the accelerations, from which their own lie"
        f" {1e3 * float(np.median(nearest)):.2f} ms apart in the median (the gyroscope begins"
        f" {1e3 * (t_gyr[0] - t[0]):+.2f} ms after the accelerometer)"
    )
    return kept, values, lost, said
