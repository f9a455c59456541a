"""Accelerations and rates of a stream in SI units, by what the file says of them and what they show."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...data import (
    ACCEL_COUNTS,
    GYRO_COUNTS,
    GYRO_RANGES_DPS,
    STANDARD_GRAVITY_MPS2,
    Mask,
    Vector,
    mps2_per_count,
    rad_s_per_count,
)
from ...errors import RecordingError
from ..hints import Hints
from . import shown_units as units
from .times import Stream
from .units import COUNTS, OF_BNO055, OF_INCREMENTS, QUANTITIES, resolve_unit

OF_COUNTS = "in counts of"
# unit of whole rates -> those of whole accelerations of some 1000 for 1 g; empty: unknown
MG_OR_CM = ("mg", "cm/s^2")
BESIDE = {COUNTS: (COUNTS,), "mdeg/s": ("mg",), "": (*MG_OR_CM, COUNTS)}
# largest |log| of the ratio to 1 g in mm/s^2 (8192 counts are farther) or counts, or to tenths or hundredths of deg/s
NEAR_LOG = 0.08
# remarks on a unit that |a| alone shows
BY_SIZE, OR_MG = " (by |a|)", " (by |a|; if these are in mg, give --units acc=mg)"
# quartile distance of |a| over its median, beyond which the median is that of a motion
SHAKEN_SCATTER = 0.25


@dataclass(frozen=True)
class Reading:
    """Samples in SI units.

    Attributes
    ----------
    values : (n, 3) m/s^2 or rad/s. how : how they were read. clipped : (n,) True where one is at the end of its range.
    """

    values: Vector
    how: str
    clipped: Mask

    @classmethod
    def of(cls, values: Vector, scale: float, how: str, *, counts: bool = False) -> Reading:
        """Return values times `scale`; counts of 16 bits are clipped at their ends."""
        ends = (values >= ACCEL_COUNTS - 1) | (values <= -ACCEL_COUNTS)
        counts = counts and bool(np.abs(values).max() <= ACCEL_COUNTS)
        return cls(values * scale, how, np.asarray(ends.any(axis=1) & counts))


def accelerations(
    values: Vector, named: str, hints: Hints, name: str, *, beside: str | None = None, rate_hz: float = math.inf
) -> Reading:
    """Return (n, 3) accelerations, in the unit that the file names (`named`), in SI units.

    Parameters
    ----------
    beside : the unit of the rates that their turning shows, COUNTS if it is none; empty if they do not turn it;
        None if that is not known.
    rate_hz : of the samples, of which these may be increments.
    """
    named = hints.units.get("acc", named)
    if "acc" not in hints.units and (centre := units.offset(values)) is not None:
        raise RecordingError(
            f"{name}: the accelerations turn about {', '.join(f'{at:.4g}' for at in centre)} in place of zero",
            "subtract from each axis what its converter gives at 0 g, such as half of its range, or name the unit with"
            " --units acc=UNIT if zero is right",
        )
    size, seen = units.typical_size(values)[0], units.acceleration_unit(values, named)
    whole = not named and units.are_counts(values)
    likely_whole = _whole_units(size, beside or "")[0] if whole and seen == "mg" else ""
    unclear = not seen or hints.accel_range_g or likely_whole == COUNTS
    if whole and _away(size, "mm/s^2") < NEAR_LOG and beside != COUNTS and not hints.accel_range_g:
        by = "(by |a|; if these are in 0.1 mg or counts, give --units acc=mg/10 or acc=counts)"
        return Reading.of(values, QUANTITIES["acc"]["mm/s^2"], f"in mm/s^2 {by}")
    if named == COUNTS or (whole and unclear):
        return _scaled_counts(values, hints, name, size, OR_MG if likely_whole and not beside else BY_SIZE)
    at_rest = units.quietest(values)
    near = "" if seen or named else units.mean_acceleration_unit(values) or units.acceleration_unit(at_rest)
    lacks_gravity = not seen and size * QUANTITIES["acc"].get(named, 1.0) < STANDARD_GRAVITY_MPS2 / units.MOST_OF_G
    if near and (beside != "" or not lacks_gravity):
        raise RecordingError(
            f"{name}: |a| varies too much to show its unit; on average, or at rest, it would be gravity in {near}",
            f"name the unit with --units acc={near}",
            f"--units acc={near}",
        )
    if lacks_gravity:
        increments = f"--units acc={OF_INCREMENTS}" if units.is_gravity(size * rate_hz) else ""
        likely = not named and units.is_gravity(size * QUANTITIES["acc"]["g"])
        of_g = f"--units acc={near or 'g'}" if near or likely else ""
        raise RecordingError(
            f"{name}: the median |a| is only {f'{size:.3g} {named}'.strip()}, so gravity is not in it",
            "give the accelerometer's own values, not the linear acceleration computed from them"
            + f", or {increments} (or deg/sample) if these are increments of velocity and angle" * bool(increments)
            + f", or {of_g} if these are in {near or 'g'}" * bool(of_g),
            increments or (of_g if likely else ""),
        )
    sure = named or not whole or units.is_gravity(size * QUANTITIES["acc"].get(seen, 0.0))
    seen = hints.units.get("acc", (likely_whole or seen if sure else "") or named)
    evidence = f"the median |a| of {size:.4g}"
    unit = resolve_unit(name, "acc", named, seen, evidence, likely=size <= units.LARGEST_OF_SI)
    return Reading.of(values, QUANTITIES["acc"][unit], f"in {unit}{OR_MG if likely_whole not in ('', 'mg') else ''}")


def _away(size: float, unit: str) -> float:
    """Return |log| of the ratio of an acceleration to 1 g in a unit, or in the counts that are nearest."""
    of_g = size / units.counts_per_g(size) if unit == COUNTS else size * QUANTITIES["acc"][unit] / STANDARD_GRAVITY_MPS2
    return abs(math.log(of_g)) if size else math.inf


def _whole_units(size: float, beside: str) -> list[str]:
    """Return the units of whole numbers of some 1000 for 1 g that occur beside such rates, the nearest first."""
    return sorted(BESIDE.get(beside, MG_OR_CM), key=lambda unit: _away(size, unit))


def _scaled_counts(values: Vector, hints: Hints, name: str, size: float, by: str) -> Reading:
    """Return (n, 3) counts, whose median magnitude is `size`, in SI units; `by` says how their range is known."""
    if units.typical_size(values)[1] > SHAKEN_SCATTER * size:
        size = units.typical_size(units.averaged(values))[0]
    per_g = units.counts_per_g(size)
    range_g = hints.accel_range_g or ACCEL_COUNTS / per_g
    scale = mps2_per_count(range_g)
    if is_wrong_full_scale(size * scale / STANDARD_GRAVITY_MPS2) and "acc" not in hints.units:
        raise RecordingError(
            f"{name}: at ±{range_g:g} g the median |a| is {size * scale:.3g} m/s^2, which is not gravity",
            "give the --accel-range that the sensor had, or --units acc=counts if it was this one",
            f"--accel-range {ACCEL_COUNTS / per_g:g}" if hints.accel_range_g else "",
        )
    if _away(size, COUNTS) > NEAR_LOG:
        by = f" (the nearest by |a|: 1 g is {size:.4g} counts, which fits no usual range)"
    by = "" if hints.accel_range_g else by
    return Reading.of(values, scale, f"{OF_COUNTS} ±{range_g:g} g{by}", counts=True)


class Rates:
    """Rates of a gyroscope beside the accelerations that they turn.

    Parameters
    ----------
    t : (n,) s. acc : (n, 3) in any unit. values : (n, 3) rates at these times. stream : the rates as the file has them.
    """

    def __init__(self, t: Vector, acc: Vector, values: Vector, stream: Stream, hints: Hints, name: str) -> None:
        self._t, self._acc, self._values, self._hints, self._name = t, acc, values, hints, name
        self._named = hints.units.get("gyr", stream.unit)
        self._factor = units.rate_factor(t, acc, values)
        self._seen = hints.units.get("gyr", units.gyro_unit(self._factor, self._named))
        self._whole = not self._named and units.are_counts(stream.values[stream.complete])

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
        if decimal[of] > NEAR_LOG:
            return None
        likely, other = _whole_units(units.typical_size(self._acc)[0], of)
        return {"acc": likely, "gyr": of}, f"|a| suggests these units, or else --units acc={other},gyr={of}"

    def read(self, *, beside_counts: bool) -> Reading:
        """Return them in SI units; `beside_counts` if the accelerations are counts."""
        counted = self.shown == COUNTS or beside_counts or self._hints.gyro_range_dps is not None
        of_counts = self._whole and counted
        if self._named == COUNTS or of_counts:
            return self._counts()
        named, seen, factor = self._named, self._seen, self._factor
        at_rest = "" if named or seen or factor else units.resting_gyro_unit(self._t, self._acc, self._values)
        if at_rest:
            by = "(by their noise and bias, as gravity hardly turns)"
            return Reading.of(self._values, QUANTITIES["gyr"][at_rest], f"rates in {at_rest} {by}")
        if not named and not seen and not (factor and self._hints.rate_hz):
            return self._left_out("their unit (--units gyr=UNIT)")
        if factor and not seen:
            known = [unit for unit in QUANTITIES["gyr"] if unit != COUNTS]
            of = named or min(known, key=lambda each: abs(math.log(abs(factor) / QUANTITIES["gyr"][each])))
            remedy = f"their unit with --units {' or '.join(f'gyr={unit}' for unit in known)}"
            raise self._wrong(factor / QUANTITIES["gyr"][of], of, remedy, f"--units gyr={of}")
        unit = resolve_unit(self._name, "gyr", named, seen, "the turning of gravity")
        return Reading.of(self._values, QUANTITIES["gyr"][unit], f"rates in {unit}{self._sign_remark()}")

    def _counts(self) -> Reading:
        range_dps = self._hints.gyro_range_dps or _gyro_range_dps(self._factor)
        if range_dps is None:
            return self._left_out("the range of their counts (--gyro-range DPS)")
        scale, of = rad_s_per_count(range_dps), f"counts of ±{range_dps:g} deg/s"
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
    # half an octave, which leaves room for gains of 0.7 to 1.4
    return ratio == 0.0 or round(math.log2(ratio)) != 0
