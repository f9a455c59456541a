"""Two streams of x, y, z with their times as one recording in SI units, and a sentence on how they were read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...data import ACCEL_COUNTS, GYRO_COUNTS, GYRO_RANGES_DPS, STANDARD_GRAVITY_MPS2, Mask, Recording, Sensor, Vector
from ...errors import RecordingError
from ..hints import Hints
from ..rows import make_recording
from . import times, units
from .clock import are_new
from .times import Stream
from .units import COUNTS, QUANTITIES, resolve_unit

# octaves: half way to the next range, which leaves room for gains of 0.7 to 1.4
ANOTHER_RANGE = 0.5
OF_COUNTS = "in counts of"
# |a| / g of whole numbers that alone shows a unit: counts of 512 for 1 g are not mg
LEAST_LIKELY, MOST_LIKELY = 0.75, 1.35
# quartile distance of |a| over its median, beyond which the median is that of a motion
SHAKING = 0.25
# samples over which shaking averages out: a few of its periods at the rates of most loggers
SHAKEN = 100


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
    left_out = "without rates" if gyr is None else ""
    gyr = replace(acc, values=np.zeros_like(acc.values), unit="rad/s") if gyr is None else gyr
    for stream, what in ((acc, "accelerations"), (gyr, "rates")):
        if np.count_nonzero(stream.complete) < 2:
            raise RecordingError(f"{name} holds {np.count_nonzero(stream.complete)} {what}", "record for longer")
        beyond = (np.abs(stream.values) >= units.BEYOND).any(axis=1)
        if beyond.any():
            raise RecordingError(
                f"{name}: the {what} of sample {int(beyond.argmax())} are not a sensor's", "leave that sample out"
            )
    acc, gyr = (
        replace(s, values=_among(s.complete, units.to_signed(s.values[s.complete]), np.nan))
        if s.unit in ("", COUNTS)
        else s
        for s in (acc, gyr)
    )
    rate_remark, untimed = "", acc.times is None or gyr.times is None
    alike = len(acc.values) == len(gyr.values) and np.array_equal(acc.number, gyr.number)
    if untimed:
        hints = replace(hints, rate_hz=hints.rate_hz or acc.rate_hz)
    if hints.rate_hz is None and untimed:
        hints = replace(hints, rate_hz=_rate_hz(acc, gyr, hints) if alike else None)
        rate_remark = "this sample rate is that at which its rates turn gravity"
        if hints.rate_hz is None:
            rate_remark = "this sample rate is assumed, as nothing shows it (--rate HZ)"
            left_out = left_out or "without rates"
    new = [are_new(stream.at_once, stream.values) for stream in (acc, gyr)]
    if untimed and alike:
        new = [are_new(None, np.hstack([acc.values, gyr.values]))] * 2
    acc, gyr = acc.part(new[0]), gyr.part(new[1])
    for stream, what in ((acc, "accelerations"), (gyr, "rates")):
        if np.count_nonzero(stream.complete) < 2:
            raise RecordingError(f"{name} repeats one sample of {what} at one time", "record it again")
    (clock, of_t), (clock_gyr, of_t_gyr) = (times.to_seconds(stream, acc, hints, name) for stream in (acc, gyr))
    complete, joined, gap, kept = acc.complete, "", clock.gap, slice(0, len(clock.t))
    if np.array_equal(clock.t, clock_gyr.t):
        complete = complete & gyr.complete
        if np.count_nonzero(complete) < 2:
            raise RecordingError(f"{name} lacks a number in nearly every sample", "record it again")
        values = gyr.values[complete]
    else:
        t = clock.t[complete]
        part, values, lost_rates, joined = times.interpolate_rates(t, clock_gyr, gyr.values, gyr.complete, name)
        inside = np.flatnonzero(complete)[part]
        kept, gap = slice(int(inside[0]), int(inside[-1]) + 1), gap.copy()
        gap[inside] |= lost_rates
    complete = complete[kept]
    t = clock.t[kept]
    a, of_a, a_clipped = _accelerations(replace(acc, values=acc.values[kept][complete]), hints, name)
    if left_out:
        w, of_w, w_clipped = _left_out(t[complete], left_out)
    else:
        of_counts = of_a.startswith(OF_COUNTS)
        w, of_w, w_clipped = _rates(t[complete], a, values, gyr.unit, hints, name, of_counts=of_counts)
    of_times = of_t if of_t == of_t_gyr else f"{of_t} and {of_t_gyr}"
    repeated, lost = int((~new[0]).sum()), max(acc.lost, gyr.lost)
    said = [
        f"{name} was read with {of_times}, accelerations {of_a} and {of_w}",
        rate_remark,
        *remarks,
        f"{repeated} repeated samples were left out" if repeated else "",
        f"{lost} lines that lack a number were left out" if lost else "",
        clock.remark,
        f"of the rates {clock_gyr.remark}" if clock_gyr.remark not in ("", clock.remark) else "",
        joined,
    ]
    recording = make_recording(
        t=t,
        acc=_among(complete, a, np.nan),
        gyr=_among(complete, w, np.nan),
        temperature_c=None if acc.temperature_c is None else acc.temperature_c[kept],
        gap=gap[kept],
        acc_clipped=_among(complete, a_clipped, False),
        gyr_clipped=_among(complete, w_clipped, False),
        sensor=Sensor(accel_range_g=hints.accel_range_g, gyro_range_dps=hints.gyro_range_dps),
        name=name,
        taken="; ".join(filter(None, said)) + ".",
    )
    return replace(recording, utc_ns=times.utc_ns(acc, of_t))


def _among(complete: Mask, values: NDArray[Any], missing: float) -> NDArray[Any]:
    """Return values of all samples: those of the complete ones (n,), and `missing` for the others."""
    found = np.full((len(complete), *values.shape[1:]), missing, values.dtype)
    found[complete] = values
    return found


def _rate_hz(acc: Stream, gyr: Stream, hints: Hints) -> float | None:
    """Return the rate of samples without times at which the rates turn gravity; None if it is not determined."""
    complete = acc.complete & gyr.complete
    values, unit = gyr.values[complete], hints.units.get("gyr", gyr.unit)
    if unit == COUNTS or (not unit and units.are_counts(values)):
        if not hints.gyro_range_dps:
            return None
        values, unit = values * np.radians(hints.gyro_range_dps) / GYRO_COUNTS, "rad/s"
    return units.likely_rate_hz(acc.values[complete], values, unit)


def _left_out(t: Vector, why: str) -> tuple[Vector, str, Mask]:
    return np.full((len(t), 3), np.nan), why, np.zeros(len(t), bool)


def _accelerations(stream: Stream, hints: Hints, name: str) -> tuple[Vector, str, Mask]:
    """Return (n, 3) m/s^2, how they were read, and (n,) True where one is clipped."""
    values, said = stream.values, hints.units.get("acc", stream.unit)
    if (centre := units.offset(values)) is not None:
        raise RecordingError(
            f"{name}: the accelerations turn about {', '.join(f'{at:.4g}' for at in centre)} in place of zero",
            "subtract from each axis what its converter gives at 0 g, such as half of its range",
        )
    size = units.typical_size(values)[0]
    seen = units.acceleration_unit(values)
    if said == COUNTS or (not said and units.are_counts(values) and (not seen or hints.accel_range_g)):
        return _scale_counts(values, hints, name, size)
    near = "" if seen or said else mean_acceleration_unit(values)
    if near:
        raise RecordingError(
            f"{name}: |a| varies too much to show its unit; on average it would be gravity in {near}",
            f"name the unit with --units acc={near}",
            f"--units acc={near}",
        )
    if not seen and size * QUANTITIES["acc"].get(said, 1.0) < units.LEAST_OF_G * STANDARD_GRAVITY_MPS2:
        raise RecordingError(
            f"{name}: the median |a| is only {size:.3g}, so gravity is not in it",
            "give the accelerometer's own values, not the linear acceleration computed from them",
        )
    likely = LEAST_LIKELY <= size * QUANTITIES["acc"].get(seen, 0.0) / STANDARD_GRAVITY_MPS2 <= MOST_LIKELY
    likely = likely or not (values == np.rint(values)).all()
    seen = hints.units.get("acc", (seen if said or likely else "") or said)
    unit = resolve_unit(name, "acc", said, seen, f"the median |a| of {size:.4g}")
    return values * QUANTITIES["acc"][unit], f"in {unit}", np.zeros(len(values), bool)


def mean_acceleration_unit(values: Vector) -> str:
    """Return the unit in which (n, 3) accelerations are gravity on average; empty if there is none."""
    whole = values[np.isfinite(values).all(axis=1)]
    return units.acceleration_unit(_averaged(whole)) if len(whole) > 1 else ""


def _averaged(values: Vector) -> Vector:
    """Return means of adjacent samples (n, 3): shaking averages out, and gravity does not."""
    width = min(SHAKEN, len(values) // 2)
    return np.column_stack([np.convolve(axis, np.full(width, 1 / width), "valid") for axis in values.T])


def _scale_counts(values: Vector, hints: Hints, name: str, size: float) -> tuple[Vector, str, Mask]:
    """Return the same of (n, 3) counts, whose median magnitude is `size`."""
    if units.typical_size(values)[1] > SHAKING * size:
        size = units.typical_size(_averaged(values))[0]
    per_g = 2 ** min(max(round(math.log2(max(size, 1.0))), units.FEWEST_PER_G), units.MOST_PER_G)
    range_g = hints.accel_range_g or ACCEL_COUNTS / per_g
    scale = range_g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS
    if is_wrong_full_scale(size * scale / STANDARD_GRAVITY_MPS2) and "acc" not in hints.units:
        raise RecordingError(
            f"{name}: at ±{range_g:g} g the median |a| is {size * scale:.3g} m/s^2, which is not gravity",
            "give the --accel-range that the sensor had, or --units acc=counts if it was this one",
            f"--accel-range {ACCEL_COUNTS / per_g:g}" if hints.accel_range_g else "",
        )
    by = "" if hints.accel_range_g else " (by |a|)"
    return values * scale, f"{OF_COUNTS} ±{range_g:g} g{by}", _is_clipped(values)


def _rates(
    t: Vector, a: Vector, values: Vector, said: str, hints: Hints, name: str, of_counts: bool
) -> tuple[Vector, str, Mask]:
    """Return (n, 3) rad/s, how they were read, and (n,) True where one is clipped.

    Parameters
    ----------
    said : their unit as the file names it. of_counts : True if the accelerations are counts.
    """
    said = hints.units.get("gyr", said)
    if said == COUNTS or (not said and units.are_counts(values) and (hints.gyro_range_dps or of_counts)):
        range_dps = hints.gyro_range_dps or _gyro_range_dps(units.rate_factor(t, a, values))
        if range_dps is None:
            return _left_out(t, "rates left out, because nothing shows the range of their counts (--gyro-range DPS)")
        scale, of = np.radians(range_dps) / GYRO_COUNTS, f"counts of ±{range_dps:g} deg/s"
        factor = units.rate_factor(t, a, values * scale)
        if factor and is_wrong_full_scale(abs(factor)) and "gyr" not in hints.units:
            fits = f"--gyro-range {_gyro_range_dps(factor * scale):g}"
            remedy = "the --gyro-range that the sensor had (if it was this one: --units gyr=counts)"
            raise _wrong_rates(name, factor, of, hints, remedy, fits)
        by = "" if hints.gyro_range_dps else " (by how gravity turns)"
        return values * scale, f"rates in {of}{by}{_sign_remark(factor)}", _is_clipped(values)
    factor = units.rate_factor(t, a, values)
    seen = hints.units.get("gyr", units.gyro_unit(factor))
    at_rest = "" if said or seen or factor else units.resting_gyro_unit(t, a, values)
    if at_rest:
        by = "(by their noise and bias, as gravity hardly turns)"
        return values * QUANTITIES["gyr"][at_rest], f"rates in {at_rest} {by}", np.zeros(len(values), bool)
    if not said and not seen and not (factor and hints.rate_hz):
        return _left_out(t, "rates left out, because nothing shows their unit (--units gyr=UNIT)")
    if factor and not seen:
        known = [unit for unit in QUANTITIES["gyr"] if unit != COUNTS]
        of = said or min(known, key=lambda each: abs(math.log(abs(factor) / QUANTITIES["gyr"][each])))
        units_known = " or ".join(f"gyr={unit}" for unit in known)
        factor /= QUANTITIES["gyr"][of]
        raise _wrong_rates(name, factor, of, hints, f"their unit with --units {units_known}", f"--units gyr={of}")
    unit = resolve_unit(name, "gyr", said, seen, "the turning of gravity")
    return values * QUANTITIES["gyr"][unit], f"rates in {unit}{_sign_remark(factor)}", np.zeros(len(values), bool)


def _gyro_range_dps(factor: float | None) -> float | None:
    """Return the range of counts by how fast gravity turns: a usual one, or else what was found; None if unknown."""
    if not factor:
        return None
    dps = math.degrees(abs(factor)) * GYRO_COUNTS
    nearest = min(GYRO_RANGES_DPS, key=lambda each: abs(math.log2(dps / each)))
    return nearest if abs(math.log2(dps / nearest)) < ANOTHER_RANGE else round(dps)


def _wrong_rates(name: str, factor: float, of: str, hints: Hints, remedy: str, options: str) -> RecordingError:
    of_times = f"--rate {hints.rate_hz / abs(factor):.3g}" if hints.rate_hz else "--units t=UNIT"
    return RecordingError(
        f"{name}: gravity turns {abs(factor):.2g} times as fast as rates in {of}",
        f"give {remedy}, or for the times {of_times}",
        options,
    )


def _sign_remark(factor: float | None) -> str:
    """Return a remark if the signs of axes are wrong; `calibrate` refuses those and names them."""
    return " (but gravity turns the other way: an axis has the wrong sign)" if factor and factor < 0 else ""


def is_wrong_full_scale(ratio: float) -> bool:
    """Return True if a ratio that should be 1 is 0, or nearer to 2, 4, 8 or an inverse of these."""
    return ratio == 0.0 or abs(math.log2(ratio)) > ANOTHER_RANGE


def _is_clipped(values: Vector) -> Mask:
    """Return (n,) True where one of (n, 3) counts is at the end of the range."""
    return np.asarray(((values >= ACCEL_COUNTS - 1) | (values <= -ACCEL_COUNTS)).any(axis=1))
