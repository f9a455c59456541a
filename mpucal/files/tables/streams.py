"""Two streams of x, y, z with their times as one recording in SI units, and a sentence on how they were read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arguments import check_increasing
from ...clocks.stamps import are_new
from ...data import Mask, Recording, Sensor, Vector, rad_s_per_count
from ...errors import RecordingError
from ..hints import Hints
from . import shown_units as units
from . import times
from .readings import OF_COUNTS, Rates, Reading, accelerations
from .table import are_many
from .times import Stream
from .units import COUNTS, OF_BNO055, PER_SAMPLE


def index_with_gravity(streams: Sequence[Stream]) -> int:
    """Return the index of the first accelerometer that measures gravity; 0 if none does."""
    whole = (s.values[s.complete] for s in streams)
    return next((i for i, values in enumerate(whole) if len(values) and units.acceleration_unit(values)), 0)


def join_streams(acc: Stream, gyr: Stream | None, hints: Hints, name: str, remarks: Sequence[str] = ()) -> Recording:
    """Return the recording of an accelerometer's and a gyroscope's stream, with NaN where a sample lacks a number.

    Rates whose range, unit or times neither the file nor the turning of gravity shows are left out (NaN).

    Parameters
    ----------
    gyr : None if there is no gyroscope.
    remarks : further clauses on how the file was read.

    Raises
    ------
    RecordingError : units are not known or do not fit, times do not overlap, or there are too few samples.
    """
    of_rate, measured = "", gyr is not None
    left_out = not measured
    gyr = replace(acc, values=np.zeros_like(acc.values), unit="rad/s") if gyr is None else gyr
    acc, gyr = _checked(acc, "accelerations", name), _checked(gyr, "rates", name)
    if acc.ticks is None or gyr.ticks is None:
        hints, of_rate = _with_rate(acc, gyr, hints)
        left_out = left_out or hints.rate_hz is None
    new = _new_samples(acc, gyr)
    acc, gyr = acc.part(new[0]), gyr.part(new[1])
    if min(np.count_nonzero(stream.complete) for stream in (acc, gyr)) < 2:
        raise RecordingError(f"{name} repeats one sample at one time", "record it again")
    (clock, of_t), (clock_gyr, of_t_gyr) = (times.to_seconds(stream, acc, hints, name) for stream in (acc, gyr))
    complete, joined, gap, kept = acc.complete, "", clock.gap, slice(0, len(clock.t))
    if np.array_equal(clock.t, clock_gyr.t):
        complete = complete & gyr.complete
        if np.count_nonzero(complete) < 2:
            raise RecordingError(f"{name} lacks a number in nearly every sample", "record it again")
        rates = gyr.values[complete]
    else:
        t = clock.t[complete]
        part, rates, lost_rates, joined = times.interpolate_rates(t, clock_gyr, gyr.values, gyr.complete, name)
        inside = np.flatnonzero(complete)[part]
        kept, gap = slice(int(inside[0]), int(inside[-1]) + 1), gap.copy()
        gap[inside] |= lost_rates
    complete, t, values = complete[kept], clock.t[kept], acc.values[kept][complete[kept]]
    by_sample = _of_increments(t[complete], (values, rates), (acc, gyr), clock.rate_hz, hints)
    values, rates = (
        of * each.rate_hz if increments else of
        for of, each, increments in zip((values, rates), (clock, clock_gyr), by_sample, strict=True)
    )
    hints = replace(hints, units={of: PER_SAMPLE.get(unit, unit) for of, unit in hints.units.items()})
    if left_out:
        a = accelerations(values, acc.unit, hints, name, rate_hz=clock.rate_hz)
        unknown = "rates left out, because nothing shows their times (--rate HZ)"
        w = Reading.of(rates, math.nan, unknown if measured else "without rates")
    else:
        rate_of = Rates(t[complete], values, rates, gyr, hints, name)
        may_be_whole = _are_whole_mg(acc, values) and not hints.units.keys() & OF_BNO055.keys()
        if may_be_whole and (whole := rate_of.whole_units()):
            hints = replace(hints, units={**hints.units, **whole[0]})
            rate_of = Rates(t[complete], values, rates, gyr, hints, name)
            remarks = [*remarks, whole[1]]
        a = accelerations(values, acc.unit, hints, name, beside=rate_of.shown, rate_hz=clock.rate_hz)
        w = rate_of.read(beside_counts=a.how.startswith(OF_COUNTS))
    of_times = of_t if of_t == of_t_gyr else f"{of_t} and {of_t_gyr}"
    repeated, lost = int((~new[0]).sum()), max(acc.lost, gyr.lost)
    remarks = [
        f"{name} was read with {of_times}, accelerations {a.how} and {w.how}",
        of_rate,
        "these are increments over a sample, times its rate" if any(by_sample) else "",
        *remarks,
        f"{repeated} repeated samples were left out" if repeated else "",
        f"{lost} lines that lack a number were left out" if lost else "",
        clock.remark,
        f"of the rates {clock_gyr.remark}" if clock_gyr.remark not in ("", clock.remark) else "",
        joined,
    ]
    warm = np.full(len(t), np.nan) if acc.temperature_c is None else acc.temperature_c[kept]
    known_c = warm[np.isfinite(warm)]
    return Recording(
        check_increasing(t, name),
        _among(complete, a.values, np.nan),
        _among(complete, w.values, np.nan),
        warm,
        gap[kept],
        _among(complete, a.clipped, False),
        _among(complete, w.clipped, False),
        sensor=Sensor(
            accel_range_g=hints.accel_range_g,
            gyro_range_dps=hints.gyro_range_dps,
            temperature_c=float(known_c.mean()) if len(known_c) else None,
        ),
        name=name,
        utc_ns=times.utc_ns(acc, of_t),
        taken="; ".join(filter(None, remarks)) + ".",
        interrupted=clock.interrupted,
    )


def _with_rate(acc: Stream, gyr: Stream, hints: Hints) -> tuple[Hints, str]:
    """Return the hints with the rate of samples without times, None if nothing shows it, and a remark on it."""
    if (said_hz := hints.rate_hz or acc.rate_hz) is not None:
        return replace(hints, rate_hz=said_hz), ""
    rate_hz = _rate_hz(acc, gyr, hints) if np.array_equal(acc.number, gyr.number) else None
    of = "assumed, as nothing shows it (--rate HZ)" if rate_hz is None else "that at which its rates turn gravity"
    return replace(hints, rate_hz=rate_hz), f"this sample rate is {of}"


def _of_increments(
    t: Vector, values: tuple[Vector, Vector], streams: tuple[Stream, Stream], rate_hz: float, hints: Hints
) -> list[bool]:
    """Return True for accelerations and rates that are increments over a sample, as the user, names or gravity say."""
    given = [hints.units.get(of, stream.unit) for of, stream in zip(OF_BNO055, streams, strict=True)]
    found = [unit in PER_SAMPLE or stream.of_increments for unit, stream in zip(given, streams, strict=True)]
    unknown = not any(given) and not any(found) and not units.acceleration_unit(values[0])
    return [units.are_increments(t, *values, rate_hz)] * 2 if unknown else found


def _checked(stream: Stream, what: str, name: str) -> Stream:
    """Return a stream whose counts have their sign, if it holds numbers that a sensor may give."""
    if np.count_nonzero(stream.complete) < 2:
        raise RecordingError(f"{name} holds {np.count_nonzero(stream.complete)} {what}", "record for longer")
    beyond = np.asarray((np.abs(stream.values) >= units.LARGEST_NUMBER).any(axis=1))
    if are_many(int(np.count_nonzero(beyond)), beyond):
        raise RecordingError(
            f"{name}: the {what} of sample {int(beyond.argmax())} are not a sensor's", "leave that sample out"
        )
    stream = replace(stream, values=np.where(beyond[:, None], np.nan, stream.values)) if beyond.any() else stream
    if stream.unit not in ("", COUNTS):
        return stream
    signed = units.to_signed(stream.values[stream.complete])
    return replace(stream, values=_among(stream.complete, signed, np.nan))


def _new_samples(acc: Stream, gyr: Stream) -> list[Mask]:
    """Return (n,) of both sensors, False where a sample repeats the one before; see are_new.

    Of samples in the same lines, both repeat: rates alone may be the same within a burst at one time, such as 0.
    """
    at_once, also = acc.at_once, gyr.at_once
    if np.array_equal(acc.number, gyr.number):
        if at_once is None or also is None:
            return [are_new(None, np.hstack([acc.values, gyr.values]))] * 2
        if np.array_equal(at_once, also):
            return [are_new(at_once, np.hstack([acc.values, gyr.values]))] * 2
    return [are_new(stream.at_once, stream.values) for stream in (acc, gyr)]


def _among(complete: Mask, values: NDArray[Any], missing: float) -> NDArray[Any]:
    """Return values of all samples: those of the complete ones (n,), and `missing` for the others."""
    found = np.full((len(complete), *values.shape[1:]), missing, values.dtype)
    found[complete] = values
    return found


def _are_whole_mg(acc: Stream, values: Vector) -> bool:
    """Return True if accelerations (n, 3) are whole numbers that seem to be in mg, as a BNO055's do."""
    named = bool(acc.unit) or not acc.whole_unit
    return not named and units.are_counts(values) and units.acceleration_unit(values) == "mg"


def _rate_hz(acc: Stream, gyr: Stream, hints: Hints) -> float | None:
    """Return the rate of samples without times at which the rates turn gravity; None if it is not determined."""
    complete = acc.complete & gyr.complete
    values, unit = gyr.values[complete], hints.units.get("gyr", gyr.unit)
    if unit == COUNTS or (not unit and units.are_counts(values)):
        if not hints.gyro_range_dps:
            return None
        values, unit = values * rad_s_per_count(hints.gyro_range_dps), "rad/s"
    return units.likely_rate_hz(acc.values[complete], values, unit)
