"""Two streams of x, y, z with their times as one recording in SI units, and how they were taken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...data import (
    ACCEL_COUNTS,
    ACCEL_RANGES_G,
    GYRO_COUNTS,
    GYRO_RANGES_DPS,
    STANDARD_GRAVITY_MPS2,
    Mask,
    Recording,
    Sensor,
    Vector,
)
from ...errors import RecordingError
from ..hints import Hints
from . import times, units
from .times import Stream
from .units import COUNTS, FULL_SCALE, QUANTITIES, check_agrees

# octaves: half of the way to the next range leaves room for gains of 0.7 to 1.4
ANOTHER_RANGE = 0.5
# of these parts, and by how many octaves what gravity says may miss one
SURE_RANGE = 0.35
OF_COUNTS = "in counts of"
# |a| of gravity that alone says a unit: counts of 512 to 1 g are no mg
LEAST_LIKELY, MOST_LIKELY = 0.75, 1.35


def with_gravity(streams: Sequence[Stream]) -> int:
    """The place of the first accelerometer that holds gravity; 0 where none does."""
    return next((i for i, s in enumerate(streams) if len(s.values) and units.acceleration_unit(s.values)), 0)


def recording_of(
    acc: Stream,
    gyr: Stream,
    hints: Hints,
    name: str,
    temperature_c: Vector | None = None,
    remarks: Sequence[str] = (),
) -> Recording:
    """The recording of an accelerometer's and a gyroscope's stream.

    Parameters
    ----------
    temperature_c : (n,) at the accelerometer's times. remarks : what else is to be said of how it was taken.

    Raises
    ------
    RecordingError : units that nothing says or that do not fit, times that do not overlap, no recording.
    """
    for stream, what in ((acc, "accelerations"), (gyr, "rates")):
        if len(stream.values) < 2:
            raise RecordingError(f"{name} holds {len(stream.values)} {what}", "record for longer")
        read = np.abs(stream.values).max(axis=1) < units.BEYOND
        if not read.all():
            raise RecordingError(
                f"{name}: sample {int(read.argmin())} has {what} that no sensor reads", "leave that sample out"
            )
    acc, gyr = (replace(s, values=units.signed(s.values)) if s.unit in ("", COUNTS) else s for s in (acc, gyr))
    fresh = acc.fresh
    temperature_c = None if temperature_c is None else temperature_c[fresh]
    again = int((~fresh).sum())
    lost = [(acc.lost, "accelerations"), (gyr.lost, "rates")]
    acc, gyr = acc.part(fresh), gyr.part(gyr.fresh)
    for stream, what in ((acc, "accelerations"), (gyr, "rates")):
        if len(stream.values) < 2:
            raise RecordingError(f"{name} holds the same {what} again and again, at one time", "record it again")
    (t, gap, of_t, even), (t_gyr, gap_gyr, of_t_gyr, even_gyr) = (
        times.seconds(stream, acc, hints, name) for stream in (acc, gyr)
    )
    a, of_a, a_clipped = _accelerations(acc, hints, name)
    joined = ""
    if not np.array_equal(t, t_gyr):
        kept, values, lost_rates, joined = times.joined(t, t_gyr, gyr.values, gap_gyr, name)
        t, a, a_clipped, gap = t[kept], a[kept], a_clipped[kept], gap[kept] | lost_rates
        temperature_c = None if temperature_c is None else temperature_c[kept]
    else:
        values = gyr.values
    w, of_w, w_clipped = _rates(t, a, values, gyr.unit, hints, name, of_counts=of_a.startswith(OF_COUNTS))
    of_times = of_t if of_t == of_t_gyr else f"{of_t} and {of_t_gyr}"
    said = [
        f"Of {name} {of_times}, accelerations {of_a} and rates {of_w} were taken as such",
        *remarks,
        f"{again} samples that are written again were left out" if again else "",
        *(f"{count} samples whose {what} lack a number were left out" for count, what in lost if count),
        even,
        f"of the rates {even_gyr}" if even_gyr not in ("", even) else "",
        joined,
    ]
    recording = Recording.from_arrays(
        t,
        a,
        w,
        temperature_c=temperature_c,
        gap=gap,
        acc_clipped=a_clipped,
        gyr_clipped=w_clipped,
        sensor=Sensor(accel_range_g=hints.accel_range_g, gyro_range_dps=hints.gyro_range_dps),
        name=name,
        taken="; ".join(filter(None, said)) + ".",
    )
    return replace(recording, utc_ns=times.utc_ns(acc, of_t))


def _seen(unit: str, hints: Hints, quantity: str) -> str:
    """What the samples say, unless a person has said it."""
    return hints.units.get(quantity, unit)


def _accelerations(stream: Stream, hints: Hints, name: str) -> tuple[Vector, str, Mask]:
    """(n, 3) m/s^2, how they were taken, and (n,) whether they stood at the end of the range."""
    values, said = stream.values, hints.units.get("acc", stream.unit)
    size = float(np.median(np.linalg.norm(values, axis=1)))
    seen = units.acceleration_unit(values)
    if said == COUNTS or (not said and are_counts(values) and (not seen or hints.accel_range_g)):
        return _scaled(values, hints, name, size)
    if not seen and size * QUANTITIES["acc"].get(said, 1.0) < units.LEAST_OF_G * STANDARD_GRAVITY_MPS2:
        raise RecordingError(
            f"{name}: |a| is {size:.3g} in the median, so that gravity is not in it",
            "give the accelerometer itself, not the linear acceleration that was made of it",
        )
    likely = LEAST_LIKELY <= size * QUANTITIES["acc"].get(seen, 0.0) / STANDARD_GRAVITY_MPS2 <= MOST_LIKELY
    how = f"|a| of {size:.4g} in the median reads"
    unit = check_agrees(name, "acc", said, _seen((seen if said or likely else "") or said, hints, "acc"), how)
    return values * QUANTITIES["acc"][unit], f"in {unit}", np.zeros(len(values), bool)


def _scaled(values: Vector, hints: Hints, name: str, size: float) -> tuple[Vector, str, Mask]:
    ranges = (g for g in ACCEL_RANGES_G if LEAST_LIKELY <= size * g / ACCEL_COUNTS <= MOST_LIKELY)
    range_g = next(ranges, None) if hints.accel_range_g is None else hints.accel_range_g
    if range_g is None:
        raise RecordingError(
            f"{name}: accelerations are counts of a range that nothing says (|a| is {size:.0f} in the median)",
            "give --accel-range G and --gyro-range DPS",
            "--accel-range G --gyro-range DPS",
        )
    scale = range_g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS
    if is_another_range(size * scale / STANDARD_GRAVITY_MPS2) and "acc" not in hints.units:
        raise RecordingError(
            f"{name}: at ±{range_g:g} g |a| is {size * scale:.3g} m/s^2 in the median, which is no gravity",
            "give the --accel-range that the sensor had, or say --units acc=counts if it was that",
            "--accel-range G",
        )
    by = "" if hints.accel_range_g else ", as |a| reads,"
    return values * scale, f"{OF_COUNTS} ±{range_g:g} g{by}", _at_the_end(values)


def _rates(
    t: Vector, a: Vector, values: Vector, said: str, hints: Hints, name: str, of_counts: bool
) -> tuple[Vector, str, Mask]:
    """(n, 3) rad/s, how they were taken, and (n,) whether they stood at the end of the range.

    of_counts : whether the accelerations are counts.
    """
    said = hints.units.get("gyr", said)
    if said == COUNTS or (not said and are_counts(values) and (hints.gyro_range_dps or of_counts)):
        range_dps = hints.gyro_range_dps or _gyro_range_dps(units.turned(t, a, values))
        if range_dps is None:
            raise RecordingError(
                f"{name}: rates are counts of a range that nothing says, and gravity does not turn as of any",
                "give --gyro-range DPS",
                "--gyro-range DPS",
            )
        scale, of = np.radians(range_dps) / GYRO_COUNTS, f"counts of ±{range_dps:g} deg/s"
        factor = units.turned(t, a, values * scale)
        if factor and is_another_range(abs(factor)) and "gyr" not in hints.units:
            raise _unlike(
                name,
                factor,
                of,
                hints,
                "the --gyro-range that the sensor had (this one: --units gyr=counts)",
            )
        by = "" if hints.gyro_range_dps else ", as gravity turns,"
        return values * scale, f"in {of}{by}{_turned_around(factor)}", _at_the_end(values)
    factor = units.turned(t, a, values)
    seen = _seen(units.rate_unit(factor), hints, "gyr")
    if factor and not seen:
        known = [unit for unit in QUANTITIES["gyr"] if unit != COUNTS]
        of = said or min(known, key=lambda each: abs(math.log(abs(factor) / QUANTITIES["gyr"][each])))
        raise _unlike(name, factor / QUANTITIES["gyr"][of], of, hints, "their unit with --units gyr=UNIT")
    unit = check_agrees(name, "gyr", said, seen, "gravity turns" if seen else "how gravity turns reads")
    return values * QUANTITIES["gyr"][unit], f"in {unit}{_turned_around(factor)}", np.zeros(len(values), bool)


def _gyro_range_dps(factor: float | None) -> float | None:
    """The range of counts by how fast gravity turns; None where no sensor has it."""
    if not factor:
        return None
    dps = math.degrees(abs(factor)) * GYRO_COUNTS
    nearest = min(GYRO_RANGES_DPS, key=lambda each: abs(math.log2(dps / each)))
    return nearest if abs(math.log2(dps / nearest)) < SURE_RANGE else None


def _unlike(name: str, factor: float, of: str, hints: Hints, remedy: str) -> RecordingError:
    of_times = "--rate HZ" if hints.rate_hz else "--units t=UNIT"
    return RecordingError(
        f"{name}: gravity turns {abs(factor):.2g} times as fast as rates in {of} say",
        f"say {remedy}, or of the times {of_times}",
        f"--units gyr={of}" if of in QUANTITIES["gyr"] else "",
    )


def _turned_around(factor: float | None) -> str:
    """What is to be said of signs: calibrate refuses them, and says which."""
    return " (gravity turns the other way, as where an axis has another sign)" if factor and factor < 0 else ""


def is_another_range(ratio: float) -> bool:
    """True where a ratio that should be 1 is 0, or nearer to 2, 4, 8 or an inverse of these: another full scale."""
    return ratio == 0.0 or abs(math.log2(ratio)) > ANOTHER_RANGE


def are_counts(values: Vector) -> bool:
    """Whether all are whole numbers of 16 bits."""
    return bool((values == np.rint(values)).all() and np.abs(values).max() <= FULL_SCALE)


def _at_the_end(values: Vector) -> Mask:
    return np.asarray(((values >= FULL_SCALE - 1) | (values <= -FULL_SCALE)).any(axis=1))
