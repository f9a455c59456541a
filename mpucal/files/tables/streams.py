"""Two streams of x, y, z with their times as one recording in SI units, and a sentence on how they were read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...clocks.stamps import are_new
from ...data import ACCEL_COUNTS, GYRO_COUNTS, GYRO_RANGES_DPS, STANDARD_GRAVITY_MPS2, Mask, Recording, Sensor, Vector
from ...errors import RecordingError
from ..hints import Hints
from ..rows import make_recording
from . import times, units
from .table import MOST_BAD
from .times import Stream
from .units import COUNTS, OF_BNO055, QUANTITIES, resolve_unit

# octaves: half way to the next range, which leaves room for gains of 0.7 to 1.4
ANOTHER_RANGE = 0.5
OF_COUNTS = "in counts of"
# |a| / g of whole numbers that alone shows a unit: counts of 512 for 1 g are not mg
LEAST_LIKELY, MOST_LIKELY = 0.75, 1.35
# Largest |log| of the ratio to 1 g in mm/s^2 (8192 counts are farther), or to tenths or hundredths of deg/s.
NEAR = 0.08
# remarks on a unit that |a| alone shows
BY_SIZE, OR_MG = " (by |a|)", " (by |a|; if these are in mg, give --units acc=mg)"
# quartile distance of |a| over its median, beyond which the median is that of a motion
SHAKING = 0.25


def index_with_gravity(streams: Sequence[Stream]) -> int:
    """Return the index of the first accelerometer that measures gravity; 0 if none does."""
    whole = (s.values[s.complete] for s in streams)
    return next((i for i, values in enumerate(whole) if len(values) and units.acceleration_unit(values)), 0)


@dataclass(frozen=True)
class Reading:
    """Samples in SI units.

    Attributes
    ----------
    values : (n, 3) m/s^2 or rad/s. said : how they were read. clipped : (n,) True where one is at the end of its range.
    """

    values: Vector
    said: str
    clipped: Mask

    @classmethod
    def of(cls, values: Vector, scale: float, said: str, *, counts: bool = False) -> Reading:
        """Return values times `scale`; counts of 16 bits are clipped at their ends."""
        ends = (values >= ACCEL_COUNTS - 1) | (values <= -ACCEL_COUNTS)
        counts = counts and bool(np.abs(values).max() <= ACCEL_COUNTS)
        return cls(values * scale, said, np.asarray(ends.any(axis=1) & counts))


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
    acc, gyr = _checked(acc, "accelerations", name), _checked(gyr, "rates", name)
    untimed, alike = acc.ticks is None or gyr.ticks is None, np.array_equal(acc.number, gyr.number)
    of_rate = ""
    if untimed:
        hints = replace(hints, rate_hz=hints.rate_hz or acc.rate_hz)
    if untimed and hints.rate_hz is None:
        hints = replace(hints, rate_hz=_rate_hz(acc, gyr, hints) if alike else None)
        of_rate = "this sample rate is that at which its rates turn gravity"
        if hints.rate_hz is None:
            of_rate = "this sample rate is assumed, as nothing shows it (--rate HZ)"
            left_out = left_out or "without rates"
    new = _new_samples(acc, gyr)
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
        rates = gyr.values[complete]
    else:
        t = clock.t[complete]
        part, rates, lost_rates, joined = times.interpolate_rates(t, clock_gyr, gyr.values, gyr.complete, name)
        inside = np.flatnonzero(complete)[part]
        kept, gap = slice(int(inside[0]), int(inside[-1]) + 1), gap.copy()
        gap[inside] |= lost_rates
    complete, t, values = complete[kept], clock.t[kept], acc.values[kept][complete[kept]]
    if left_out:
        a = _accelerations(values, acc.unit, hints, name)
        w = Reading.of(rates, math.nan, left_out)
    else:
        rate_of = _Rates(t[complete], values, rates, gyr, hints, name)
        may_be_whole = _are_whole_mg(acc, values) and not hints.units.keys() & OF_BNO055.keys()
        if may_be_whole and (whole := rate_of.whole_units()):
            hints = replace(hints, units={**hints.units, **whole[0]})
            rate_of = _Rates(t[complete], values, rates, gyr, hints, name)
            remarks = [*remarks, whole[1]]
        a = _accelerations(values, acc.unit, hints, name, beside=rate_of.shown)
        w = rate_of.read(beside_counts=a.said.startswith(OF_COUNTS))
    of_times = of_t if of_t == of_t_gyr else f"{of_t} and {of_t_gyr}"
    repeated, lost = int((~new[0]).sum()), max(acc.lost, gyr.lost)
    said = [
        f"{name} was read with {of_times}, accelerations {a.said} and {w.said}",
        of_rate,
        *remarks,
        f"{repeated} repeated samples were left out" if repeated else "",
        f"{lost} lines that lack a number were left out" if lost else "",
        clock.remark,
        f"of the rates {clock_gyr.remark}" if clock_gyr.remark not in ("", clock.remark) else "",
        joined,
    ]
    recording = make_recording(
        t=t,
        acc=_among(complete, a.values, np.nan),
        gyr=_among(complete, w.values, np.nan),
        temperature_c=None if acc.temperature_c is None else acc.temperature_c[kept],
        gap=gap[kept],
        acc_clipped=_among(complete, a.clipped, False),
        gyr_clipped=_among(complete, w.clipped, False),
        sensor=Sensor(accel_range_g=hints.accel_range_g, gyro_range_dps=hints.gyro_range_dps),
        name=name,
        taken="; ".join(filter(None, said)) + ".",
    )
    return replace(recording, utc_ns=times.utc_ns(acc, of_t))


def _checked(stream: Stream, what: str, name: str) -> Stream:
    """Return a stream whose counts have their sign, if it holds numbers that a sensor may give."""
    if np.count_nonzero(stream.complete) < 2:
        raise RecordingError(f"{name} holds {np.count_nonzero(stream.complete)} {what}", "record for longer")
    beyond = np.asarray((np.abs(stream.values) >= units.BEYOND).any(axis=1))
    if np.count_nonzero(beyond) > MOST_BAD * len(beyond):
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
        values, unit = values * np.radians(hints.gyro_range_dps) / GYRO_COUNTS, "rad/s"
    return units.likely_rate_hz(acc.values[complete], values, unit)


def _accelerations(values: Vector, said: str, hints: Hints, name: str, *, beside: str = "") -> Reading:
    """Return (n, 3) accelerations, in the unit `said` by the file, in SI units.

    Parameters
    ----------
    beside : the unit of the rates that their turning shows, COUNTS if it is none; empty if it shows nothing.
    """
    said = hints.units.get("acc", said)
    if "acc" not in hints.units and (centre := units.offset(values)) is not None:
        raise RecordingError(
            f"{name}: the accelerations turn about {', '.join(f'{at:.4g}' for at in centre)} in place of zero",
            "subtract from each axis what its converter gives at 0 g, such as half of its range, or name the unit with"
            " --units acc=UNIT if zero is right",
        )
    size, seen = units.typical_size(values)[0], units.acceleration_unit(values, said)
    whole = not said and units.are_counts(values)
    likely_whole = _whole_unit(size, beside) if whole and seen == "mg" else ""
    unclear = not seen or hints.accel_range_g or likely_whole == COUNTS
    if whole and _away(size, "mm/s^2") < NEAR and beside != COUNTS and not hints.accel_range_g:
        return Reading.of(
            values, QUANTITIES["acc"]["mm/s^2"], "in mm/s^2 (by |a|; if these are counts, give --units acc=counts)"
        )
    if said == COUNTS or (whole and unclear):
        return _scaled_counts(values, hints, name, size, OR_MG if likely_whole and not beside else BY_SIZE)
    near = "" if seen or said else units.mean_acceleration_unit(values)
    if near:
        raise RecordingError(
            f"{name}: |a| varies too much to show its unit; on average it would be gravity in {near}",
            f"name the unit with --units acc={near}",
            f"--units acc={near}",
        )
    if not seen and size * QUANTITIES["acc"].get(said, 1.0) < units.LEAST_OF_G * STANDARD_GRAVITY_MPS2:
        raise RecordingError(
            f"{name}: the median |a| is only {f'{size:.3g} {said}'.strip()}, so gravity is not in it",
            "give the accelerometer's own values, not the linear acceleration computed from them",
        )
    likely = LEAST_LIKELY <= size * QUANTITIES["acc"].get(seen, 0.0) / STANDARD_GRAVITY_MPS2 <= MOST_LIKELY
    likely = likely or not (values == np.rint(values)).all()
    seen = hints.units.get("acc", (likely_whole or seen if said or likely else "") or said)
    unit = resolve_unit(name, "acc", said, seen, f"the median |a| of {size:.4g}")
    return Reading.of(values, QUANTITIES["acc"][unit], f"in {unit}{OR_MG if likely_whole not in ('', 'mg') else ''}")


def _away(size: float, unit: str) -> float:
    """Return |log| of the ratio of an acceleration to 1 g in a unit."""
    return abs(math.log(size * QUANTITIES["acc"][unit] / STANDARD_GRAVITY_MPS2)) if size else math.inf


def _mg_or_cm(size: float) -> list[str]:
    """Return mg and cm/s^2, first the one in which an acceleration is nearer to 1 g."""
    return sorted(("mg", "cm/s^2"), key=lambda unit: _away(size, unit))


def _whole_unit(size: float, beside: str) -> str:
    """Return the unit of whole numbers of some 1000 for 1 g: the nearest of those that occur beside such rates."""
    if beside in (COUNTS, "mdeg/s"):
        return COUNTS if beside == COUNTS else "mg"
    nearest = _mg_or_cm(size)[0]
    return COUNTS if not beside and abs(math.log(size / _counts_per_g(size))) < _away(size, nearest) else nearest


def _counts_per_g(size: float) -> int:
    """Return the counts for 1 g, of those that sensors have, that are nearest to an acceleration."""
    return 1 << min(max(round(math.log2(max(size, 1.0))), units.FEWEST_PER_G), units.MOST_PER_G)


def _scaled_counts(values: Vector, hints: Hints, name: str, size: float, by: str) -> Reading:
    """Return (n, 3) counts, whose median magnitude is `size`, in SI units; `by` says how their range is known."""
    if units.typical_size(values)[1] > SHAKING * size:
        size = units.typical_size(units.averaged(values))[0]
    per_g = _counts_per_g(size)
    range_g = hints.accel_range_g or ACCEL_COUNTS / per_g
    scale = range_g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS
    if is_wrong_full_scale(size * scale / STANDARD_GRAVITY_MPS2) and "acc" not in hints.units:
        raise RecordingError(
            f"{name}: at ±{range_g:g} g the median |a| is {size * scale:.3g} m/s^2, which is not gravity",
            "give the --accel-range that the sensor had, or --units acc=counts if it was this one",
            f"--accel-range {ACCEL_COUNTS / per_g:g}" if hints.accel_range_g else "",
        )
    by = "" if hints.accel_range_g else by
    return Reading.of(values, scale, f"{OF_COUNTS} ±{range_g:g} g{by}", counts=True)


class _Rates:
    """Rates of a gyroscope beside the accelerations that they turn.

    Parameters
    ----------
    t : (n,) s. acc : (n, 3) in any unit. values : (n, 3) rates at these times. stream : the rates as the file has them.
    """

    def __init__(self, t: Vector, acc: Vector, values: Vector, stream: Stream, hints: Hints, name: str) -> None:
        self._t, self._acc, self._values, self._hints, self._name = t, acc, values, hints, name
        self._said = hints.units.get("gyr", stream.unit)
        self._factor = units.rate_factor(t, acc, values)
        self._seen = hints.units.get("gyr", units.gyro_unit(self._factor, self._said))
        self._whole = not self._said and units.are_counts(stream.values[stream.complete])

    @property
    def shown(self) -> str:
        """Return their unit as they turn gravity, COUNTS if they are whole and turn it as in none; or empty."""
        return self._seen or (COUNTS if self._whole and self._factor else "")

    def whole_units(self) -> tuple[dict[str, str], str] | None:
        """Return the units of both sensors, beside accelerations that seem to be in whole mg, and a remark on them.

        None if these rates are no whole numbers, or in no such unit.
        """
        if not self._whole or not self._factor:
            return None
        if self._seen == "mrad/s":
            return OF_BNO055, "these may be the counts of a BNO055, or else --units acc=mg,gyr=mrad/s"
        decimal = {of: abs(math.log(abs(self._factor) / QUANTITIES["gyr"][of])) for of in ("deg/s/10", "deg/s/100")}
        of = min(decimal, key=decimal.__getitem__)
        if decimal[of] > NEAR:
            return None
        likely, other = _mg_or_cm(units.typical_size(self._acc)[0])
        return {"acc": likely, "gyr": of}, f"|a| suggests these units, or else --units acc={other},gyr={of}"

    def read(self, *, beside_counts: bool) -> Reading:
        """Return them in SI units; `beside_counts` if the accelerations are counts."""
        counted = self.shown == COUNTS or beside_counts or self._hints.gyro_range_dps is not None
        of_counts = self._whole and counted
        if self._said == COUNTS or of_counts:
            return self._counts()
        said, seen, factor = self._said, self._seen, self._factor
        at_rest = "" if said or seen or factor else units.resting_gyro_unit(self._t, self._acc, self._values)
        if at_rest:
            by = "(by their noise and bias, as gravity hardly turns)"
            return Reading.of(self._values, QUANTITIES["gyr"][at_rest], f"rates in {at_rest} {by}")
        if not said and not seen and not (factor and self._hints.rate_hz):
            return self._left_out("their unit (--units gyr=UNIT)")
        if factor and not seen:
            known = [unit for unit in QUANTITIES["gyr"] if unit != COUNTS]
            of = said or min(known, key=lambda each: abs(math.log(abs(factor) / QUANTITIES["gyr"][each])))
            remedy = f"their unit with --units {' or '.join(f'gyr={unit}' for unit in known)}"
            raise self._wrong(factor / QUANTITIES["gyr"][of], of, remedy, f"--units gyr={of}")
        unit = resolve_unit(self._name, "gyr", said, seen, "the turning of gravity")
        return Reading.of(self._values, QUANTITIES["gyr"][unit], f"rates in {unit}{self._sign_remark()}")

    def _counts(self) -> Reading:
        range_dps = self._hints.gyro_range_dps or _gyro_range_dps(self._factor)
        if range_dps is None:
            return self._left_out("the range of their counts (--gyro-range DPS)")
        scale, of = np.radians(range_dps) / GYRO_COUNTS, f"counts of ±{range_dps:g} deg/s"
        if self._factor and is_wrong_full_scale(abs(self._factor) / scale) and "gyr" not in self._hints.units:
            fits = f"--gyro-range {_gyro_range_dps(self._factor):g}"
            remedy = "the --gyro-range that the sensor had (if it was this one: --units gyr=counts)"
            raise self._wrong(self._factor / scale, of, remedy, fits)
        by = "" if self._hints.gyro_range_dps else " (by how gravity turns)"
        return Reading.of(self._values, scale, f"rates in {of}{by}{self._sign_remark()}", counts=True)

    def _left_out(self, unknown: str) -> Reading:
        return Reading.of(self._values, math.nan, f"rates left out, because nothing shows {unknown}")

    def _wrong(self, factor: float, of: str, remedy: str, options: str) -> RecordingError:
        rate_hz = self._hints.rate_hz
        of_times = f"--rate {rate_hz / abs(factor):.3g}" if rate_hz else "--units t=UNIT"
        return RecordingError(
            f"{self._name}: gravity turns {abs(factor):.2g} times as fast as rates in {of}",
            f"give {remedy}, or for the times {of_times}",
            options,
        )

    def _sign_remark(self) -> str:
        """Return a remark if the signs of axes are wrong; `calibrate` refuses those and names them."""
        flipped = self._factor is not None and self._factor < 0
        return " (but gravity turns the other way: an axis has the wrong sign)" if flipped else ""


def _gyro_range_dps(factor: float | None) -> float | None:
    """Return the range of counts by how fast gravity turns: a usual one, times a power of two; None if unknown."""
    if not factor:
        return None
    usual = GYRO_RANGES_DPS[0]
    return float(usual * 2.0 ** round(math.log2(math.degrees(abs(factor)) * GYRO_COUNTS / usual)))


def is_wrong_full_scale(ratio: float) -> bool:
    """Return True if a ratio that should be 1 is 0, or nearer to 2, 4, 8 or an inverse of these."""
    return ratio == 0.0 or abs(math.log2(ratio)) > ANOTHER_RANGE
