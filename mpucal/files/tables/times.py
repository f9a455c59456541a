"""Samples of one sensor with their times, and the times of two sensors as those of one recording, in seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import compress, pairwise
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...data import Mask, Vector
from ...errors import RecordingError
from ..hints import Hints
from . import units
from .clock import even, period_of
from .units import QUANTITIES, check_agrees

Times = Sequence[Decimal] | NDArray[Any]
# periods between two rates over which nothing is interpolated
LOST_PERIODS = 3.5
NS_OF = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1, "0.1ms": 10**5}
# from 2001 to 2100: a time of day, and not one since a start
UTC_NS = (10**18, 41 * 10**17)


@dataclass(frozen=True)
class Stream:
    """What one sensor measured.

    Attributes
    ----------
    times : (n,) exact: decimals, integers or floats; None: there are none.
    values : (n, 3) as they stand in the file. time_unit, unit : as the file says them; empty where it does not.
    zero_ns : the time of day at time 0, in ns since 1970, where a file beside it says that.
    there : of all lines, those of its samples; the others lack a number. lost : how many of them are a loss.
    """

    times: Times | None
    values: Vector
    time_unit: str = ""
    unit: str = ""
    zero_ns: int | None = None
    there: Mask | EllipsisType = ...
    lost: int = 0

    def part(self, kept: Mask) -> Stream:
        """Its samples where `kept` (n,) is."""
        if self.times is None or isinstance(self.times, np.ndarray):
            times = None if self.times is None else self.times[kept]
            return replace(self, times=times, values=self.values[kept])
        return replace(self, times=list(compress(self.times, kept)), values=self.values[kept])

    @property
    def fresh(self) -> Mask:
        """(n,) whether a sample is not the one before again, as loggers write it beside another sensor's.

        Where samples that differ have the same time, times are rounded, and so those that do not may be two.
        """
        again = np.zeros(len(self.values), bool)
        if self.times is not None and len(again):
            at_once = np.array([b == a for a, b in pairwise(self.times)], bool)
            alike = (self.values[1:] == self.values[:-1]).all(axis=1)
            again[1:] = at_once & alike & (np.count_nonzero(at_once & ~alike) <= np.count_nonzero(at_once & alike))
        return ~again


def utc_ns(stream: Stream, of_t: str) -> int | None:
    """The time of day of the first sample, where its time is one: ns since 1970."""
    unit = of_t.removeprefix("times in ")
    if stream.times is None or unit not in QUANTITIES["t"]:
        return None
    first = round(Decimal(str(stream.times[0])) * NS_OF[unit]) + (stream.zero_ns or 0)
    return possible_utc_ns(first)


def possible_utc_ns(ns: int) -> int | None:
    """A time of day [ns since 1970]; None for one that no recording is of."""
    return ns if UTC_NS[0] < ns < UTC_NS[1] else None


def seconds(stream: Stream, first: Stream, hints: Hints, name: str) -> tuple[Vector, Mask, str, str]:
    """Times (n,) [s] since the first stream's first, gaps, how they were taken, and what is to be said of its clock."""
    none = np.zeros(len(stream.values), bool)
    if stream.times is None or first.times is None:
        if hints.rate_hz is None:
            raise RecordingError(f"{name} holds no times", "give the rate of its samples with --rate HZ", "--rate HZ")
        places = np.flatnonzero(np.ones(len(stream.values), bool) if stream.there is ... else stream.there)
        return places / hints.rate_hz, none, f"a rate of {hints.rate_hz:g} Hz", ""
    ticks = _since(stream.times, first.times[0])
    if not (np.abs(ticks) < units.BEYOND**2).all():
        raise RecordingError(f"{name} holds times that are none", "leave those lines out")
    step, said = period_of(ticks), hints.units.get("t", stream.time_unit)
    how = f"their step of {step:g} reads"
    unit = check_agrees(name, "t", said, hints.units.get("t", units.time_unit(step, said)), how)
    t = ticks * QUANTITIES["t"][unit]
    back = np.diff(t) < 0
    if back.any():
        at = int(back.argmax()) + 1
        raise RecordingError(
            f"{name}: time does not increase at sample {at} ({t[at - 1]:.6f} s, then {t[at]:.6f} s)",
            "sort the samples by time, or leave out the times with --columns, and give --rate HZ",
        )
    fitted = even(t)
    if fitted is not None:
        return fitted.t, fitted.gap, f"times in {unit}", fitted.said
    return t, none, f"times in {unit}", ""


def _since(times: Times, origin: Any) -> Vector:
    """(n,) times without the digits that they share."""
    if isinstance(times, np.ndarray):
        # of infinite times `seconds` says what they are
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(times - origin, float)
    return np.array([float(time - origin) for time in times])


def joined(t: Vector, t_gyr: Vector, rates: Vector, gap: Mask, name: str) -> tuple[slice, Vector, Mask, str]:
    """Which accelerations lie within the rates' time, the rates at their times, gaps, and what to say of it.

    gap : (n,) where rates are missing before.
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
