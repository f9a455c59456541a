"""Two streams of x, y, z with their times as one recording in SI units, and how they were taken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...data import STANDARD_GRAVITY_MPS2, Mask, Recording, Sensor, Vector
from ...errors import RecordingError
from ..hints import Hints
from . import units
from .units import COUNTS, QUANTITIES, check_agrees

Times = Sequence[Decimal] | NDArray[Any]
FULL_SCALE = 32768
# octaves: half of the way to the next range leaves room for gains of 0.7 to 1.4
ANOTHER_RANGE = 0.5
# periods between two rates over which nothing is interpolated
LOST_PERIODS = 3.5


NS_OF = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
# from 2001 to 2100: a time of day, and not one since a start
UTC_NS = (10**18, 41 * 10**17)


@dataclass(frozen=True)
class Stream:
    """What one sensor measured.

    Attributes
    ----------
    times : (n,) exact: decimals, integers or floats; None: there are none.
    values : (n, 3) as they stand in the file. time_unit, unit : as the file says them; empty where it does not.
    """

    times: Times | None
    values: Vector
    time_unit: str = ""
    unit: str = ""


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
        if len(stream.values) < 2 or not (np.abs(stream.values) < units.BEYOND).all():
            raise RecordingError(
                f"{name} holds {len(stream.values)} {what}, or some that no sensor reads",
                "record for longer, or leave those lines out",
            )
    (t, of_t), (t_gyr, of_t_gyr) = _seconds(acc, acc, hints, name), _seconds(gyr, acc, hints, name)
    a, of_a, a_clipped = _accelerations(acc, hints, name)
    joined = ""
    if not np.array_equal(t, t_gyr):
        kept, values, gap, joined = _joined(t, t_gyr, gyr.values, name)
        t, a, a_clipped = t[kept], a[kept], a_clipped[kept]
        temperature_c = None if temperature_c is None else temperature_c[kept]
    else:
        values, gap = gyr.values, np.zeros(len(t), bool)
    w, of_w, w_clipped = _rates(t, a, values, gyr.unit, hints, name)
    times = of_t if of_t == of_t_gyr else f"{of_t} and {of_t_gyr}"
    said = [f"Of {name} {times}, accelerations {of_a} and rates {of_w} were taken as such", *remarks, joined]
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
    return replace(recording, utc_ns=_utc_ns(acc, of_t))


def _utc_ns(stream: Stream, of_t: str) -> int | None:
    """The time of day of the first sample, where its time is one: ns since 1970."""
    unit = of_t.removeprefix("times in ")
    if stream.times is None or unit not in QUANTITIES["t"]:
        return None
    first = round(Decimal(str(stream.times[0])) * NS_OF[unit])
    return first if UTC_NS[0] < first < UTC_NS[1] else None


def _seconds(stream: Stream, first: Stream, hints: Hints, name: str) -> tuple[Vector, str]:
    """Times (n,) [s] since the first stream's first, and how they were taken."""
    if stream.times is None or first.times is None:
        if hints.rate_hz is None:
            raise RecordingError(f"{name} holds no times", "give the rate of its samples with --rate HZ")
        return np.arange(len(stream.values)) / hints.rate_hz, f"a rate of {hints.rate_hz:g} Hz"
    ticks = _since(stream.times, first.times[0])
    if not (np.abs(ticks) < units.BEYOND**2).all():
        raise RecordingError(f"{name} holds times that are none", "leave those lines out")
    steps = np.diff(ticks)
    # a burst of samples may come with one time
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    how = f"their step of {step:g} reads"
    unit = check_agrees(
        name, "t", hints.units.get("t", stream.time_unit), _seen(units.time_unit(step), hints, "t"), how
    )
    t = ticks * QUANTITIES["t"][unit]
    back = np.diff(t) <= 0
    if back.any():
        at = int(back.argmax()) + 1
        raise RecordingError(
            f"{name}: time does not increase at sample {at} ({t[at - 1]:.6f} s, then {t[at]:.6f} s)",
            "sort the samples by time and drop repeated ones",
        )
    return t, f"times in {unit}"


def _seen(unit: str, hints: Hints, quantity: str) -> str:
    """What the samples say, unless a person has said it."""
    return hints.units.get(quantity, unit)


def _since(times: Times, origin: Any) -> Vector:
    """(n,) times without the digits that they share."""
    if isinstance(times, np.ndarray):
        return np.asarray(times - origin, float)
    return np.array([float(time - origin) for time in times])


def _accelerations(stream: Stream, hints: Hints, name: str) -> tuple[Vector, str, Mask]:
    """(n, 3) m/s^2, how they were taken, and (n,) whether they stood at the end of the range."""
    values, said = stream.values, hints.units.get("acc", stream.unit)
    size = float(np.median(np.linalg.norm(values, axis=1)))
    seen = units.acceleration_unit(values)
    if said == COUNTS or (not said and _are_counts(values) and (not seen or hints.accel_range_g)):
        return _scaled(values, hints, name, size)
    if not seen and size * QUANTITIES["acc"].get(said, 1.0) < units.LEAST_OF_G * STANDARD_GRAVITY_MPS2:
        raise RecordingError(
            f"{name}: |a| is {size:.3g} in the median, so that gravity is not in it",
            "give the accelerometer itself, not the linear acceleration that was made of it",
        )
    how = f"|a| of {size:.4g} in the median reads"
    unit = check_agrees(name, "acc", said, _seen(seen or said, hints, "acc"), how)
    return values * QUANTITIES["acc"][unit], f"in {unit}", np.zeros(len(values), bool)


def _scaled(values: Vector, hints: Hints, name: str, size: float) -> tuple[Vector, str, Mask]:
    if hints.accel_range_g is None:
        likely = next((g for g in (2, 4, 8, 16) if 0.75 <= size * g / FULL_SCALE <= 1.35), None)
        reads = f" (|a| of {size:.0f} in the median reads as of ±{likely} g)" if likely else ""
        raise RecordingError(
            f"{name}: accelerations are counts of a range that nothing says{reads}",
            f"give --accel-range {likely or 'G'} and --gyro-range DPS",
        )
    scale = hints.accel_range_g * STANDARD_GRAVITY_MPS2 / FULL_SCALE
    if is_another_range(size * scale / STANDARD_GRAVITY_MPS2) and "acc" not in hints.units:
        raise RecordingError(
            f"{name}: at ±{hints.accel_range_g:g} g |a| is {size * scale:.3g} m/s^2 in the median, which is no gravity",
            "give the --accel-range that the sensor had, or say --units acc=counts if it was that",
        )
    return values * scale, f"in counts of ±{hints.accel_range_g:g} g", _at_the_end(values)


def _rates(t: Vector, a: Vector, values: Vector, said: str, hints: Hints, name: str) -> tuple[Vector, str, Mask]:
    """(n, 3) rad/s, how they were taken, and (n,) whether they stood at the end of the range."""
    said = hints.units.get("gyr", said)
    if said == COUNTS or (not said and _are_counts(values) and (hints.gyro_range_dps or hints.accel_range_g)):
        if hints.gyro_range_dps is None:
            raise RecordingError(f"{name}: rates are counts of a range that nothing says", "give --gyro-range DPS")
        scale = np.radians(hints.gyro_range_dps) / FULL_SCALE
        factor = units.turned(t, a, values * scale)
        if factor and is_another_range(abs(factor)) and "gyr" not in hints.units:
            raise RecordingError(
                f"{name}: gravity turns {abs(factor):.2g} times as fast as counts of"
                f" ±{hints.gyro_range_dps:g} deg/s say",
                "give the --gyro-range that the sensor had, or say --units gyr=counts if it was that",
            )
        return values * scale, f"in counts of ±{hints.gyro_range_dps:g} deg/s", _at_the_end(values)
    seen = _seen(units.rate_unit(t, a, values), hints, "gyr")
    how = "gravity turns" if seen else "how gravity turns reads"
    unit = check_agrees(name, "gyr", said, seen, how)
    return values * QUANTITIES["gyr"][unit], f"in {unit}", np.zeros(len(values), bool)


def is_another_range(ratio: float) -> bool:
    """Whether what should be 1 is nearer to 2, 4, 8 or their inverses, as with another full scale of the same chip."""
    return abs(math.log2(ratio)) > ANOTHER_RANGE


def _are_counts(values: Vector) -> bool:
    return bool((values == np.rint(values)).all() and np.abs(values).max() <= FULL_SCALE)


def _at_the_end(values: Vector) -> Mask:
    return np.asarray(((values >= FULL_SCALE - 1) | (values <= -FULL_SCALE)).any(axis=1))


def _joined(t: Vector, t_gyr: Vector, rates: Vector, name: str) -> tuple[slice, Vector, Mask, str]:
    """Which accelerations lie within the rates' time, the rates at their times, gaps, and what to say of it."""
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
    lost = apart > LOST_PERIODS * float(np.median(np.diff(t_gyr)))
    nearest = np.minimum(np.abs(at - t_gyr[after - 1]), np.abs(t_gyr[after] - at))
    said = (
        f"the rates were interpolated to the times of the accelerations, from which their own lie"
        f" {1e3 * float(np.median(nearest)):.2f} ms apart in the median (the gyroscope begins"
        f" {1e3 * (t_gyr[0] - t[0]):+.2f} ms after the accelerometer)"
    )
    return kept, values, lost, said
