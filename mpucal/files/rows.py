"""Recordings as runs of samples, for files that are larger than memory, and checks of samples without metadata."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import is_plausible
from ..data import Autopilot, Mask, Recording, Samples, Sensor, Vector
from ..errors import RecordingError
from ..origin import Origin
from .tables.clock import FEWEST, fit_even_clock
from .tables.units import QUANTITIES, acceleration_unit, gyro_unit, rate_factor

# 16 Ki samples take 1 MB, which fits a cache; for larger products BLAS starts threads, which takes longer
ROWS = 1 << 14
SI = ("m/s^2", "rad/s")
SAMPLE_FIELDS = tuple(f.name for f in fields(Samples))


@dataclass(frozen=True)
class Rows:
    """A recording as runs of samples.

    Attributes
    ----------
    runs : of some ROWS samples each at most; can be iterated once.
    sensor, flat, autopilot, recovered, name, utc_ns, taken : as of a Recording.
    others : number of further IMUs in the file.
    done : the processing of samples that are calibrated already; empty if they are not.
    noise : (2, 3) standard deviations of a sample's acc [m/s^2] and gyr [rad/s]; NaN: unknown.
    plain : units are known only by convention, and numbers may be missing (NaN).
    """

    runs: Iterator[Samples]
    sensor: Sensor = field(default_factory=Sensor)
    flat: tuple[int, int] | None = None
    autopilot: Autopilot | None = None
    recovered: str | None = None
    name: str = "recording"
    others: int = 0
    done: str = ""
    noise: Vector = field(default_factory=lambda: np.full((2, 3), np.nan))
    utc_ns: int | None = None
    taken: str | None = None
    plain: bool = False

    @classmethod
    def of(cls, recording: Recording, done: str = "") -> Rows:
        """Return the rows of a recording in memory."""
        return cls(
            (recording.part(first, first + ROWS) for first in range(0, len(recording), ROWS)),
            recording.sensor,
            recording.flat,
            recording.autopilot,
            recording.recovered,
            recording.name,
            len(recording.others),
            done,
            utc_ns=recording.utc_ns,
            taken=recording.taken,
        )

    def recording(self) -> Recording:
        """Return the whole recording, checked; see Recording.from_arrays."""
        arrays: dict[str, Any] = {**vars(Samples.joined(list(self.runs))), "flat": self.flat}
        arrays, made = normalise(arrays, self.name, self.sensor) if self.plain else (arrays, None)
        taken = " ".join(filter(None, (self.taken, made))) or None
        recording = Recording.from_arrays(**arrays, sensor=self.sensor, name=self.name, taken=taken)
        return replace(recording, autopilot=self.autopilot, recovered=self.recovered, utc_ns=self.utc_ns)


Write = Callable[[Samples], None]


def normalise(arrays: Mapping[str, Any], name: str, sensor: Sensor) -> tuple[dict[str, Any], str | None]:
    """Return arguments of Recording.from_arrays without missing numbers, in SI units, with even times, and a remark.

    Arrays that are not a recording are returned unchanged, and from_arrays refuses them.
    """
    made = dict(arrays)
    t, acc, gyr = (np.asarray(arrays[key]) for key in ("t", "acc", "gyr"))
    shapes = (*t.shape, 3), acc.shape, gyr.shape
    if any(each.dtype.kind not in "fiu" for each in (t, acc, gyr)) or len(set(shapes)) > 1 or not len(t):
        return made, None
    remarks = []
    complete = _is_complete(acc, gyr)
    if not complete.all() and np.count_nonzero(complete) > 1:
        by_sample = {key for key, value in arrays.items() if value is not None and np.shape(value)[:1] == t.shape}
        made |= {key: np.asarray(arrays[key])[complete] for key in by_sample - {"flat"}}
        # a gap precedes the sample after those that were left out
        made["gap"] = _add_gaps(made.get("gap"), np.append(False, ~complete[:-1])[complete])
        kept, flat = np.append(0, np.cumsum(complete)), made.get("flat")
        made["flat"] = flat and (int(kept[flat[0]]), int(kept[flat[1]]))
        remarks.append(f"{len(t) - len(made['t'])} samples that lack a number were left out")
    with np.errstate(over="ignore", invalid="ignore"):
        t, acc, gyr = (np.asarray(made[key], float) for key in ("t", "acc", "gyr"))
    if len(t) < FEWEST or not np.isfinite(t).all() or (np.diff(t) < 0).any() or not _is_complete(acc, gyr).all():
        return made, None
    clock = None if sensor.origin is Origin.VEHICLE else fit_even_clock(t)
    if clock is not None:
        t = clock.t
        made |= {"t": clock.t, "gap": _add_gaps(made.get("gap"), clock.gap)}
        remarks.append(clock.description)
    units = (acceleration_unit(acc), gyro_unit(rate_factor(t, acc, gyr)))
    for key, unit, si in (("acc", units[0], SI[0]), ("gyr", units[1], SI[1])):
        if unit not in ("", si):
            made[key] = np.asarray(made[key], float) * QUANTITIES[key][unit]
            remarks.append(f"{key} was read in {unit}, which its values suggest")
    return made, f"{name}: {'; '.join(remarks)}." if remarks else None


def _add_gaps(gap: Any, more: Mask) -> Mask:
    return more if gap is None else np.asarray(gap, bool) | more


def _is_complete(acc: Vector, gyr: Vector) -> Mask:
    """Return (n,) True where a sample has all its numbers; an accelerometer alone has no rates at all."""
    rates = is_plausible(gyr).all(axis=1)
    return np.asarray(is_plausible(acc).all(axis=1) & (rates | ~rates.any()))


def drop_incomplete(samples: Samples) -> Samples:
    """Return the samples that have all their numbers, with gaps in place of the others."""
    complete = _is_complete(samples.acc, samples.gyr)
    if complete.all():
        return samples
    gap = samples.gap | np.append(False, ~complete[:-1])
    kept = {key: getattr(samples, key)[complete] for key in SAMPLE_FIELDS}
    return Samples(**kept | {"gap": gap[complete]})


def check_runs(runs: Iterator[Samples], name: str) -> Iterator[Samples]:
    """Yield the runs, checked as the samples of a Recording are; an impossible number becomes NaN.

    Raises
    ------
    RecordingError : there is no complete sample, or t is not finite or decreases.
    """
    at, last, any_complete = 0, -np.inf, False
    for samples in runs:
        finite = np.isfinite(samples.t)
        if not finite.all():
            raise RecordingError(
                f"{name}: t is not a finite number in sample {at + int(finite.argmin())}",
                "leave out that sample, and keep the times of the others",
            )
        for values in (samples.acc, samples.gyr):
            values[~is_plausible(values)] = np.nan
        any_complete |= bool(_is_complete(samples.acc, samples.gyr).any())
        with np.errstate(over="ignore"):
            back = np.diff(samples.t, prepend=last) < 0
        if back.any():
            raise RecordingError(
                f"{name}: time does not increase at sample {at + int(back.argmax())}",
                "sort the samples by time and drop repeated ones",
            )
        at, last = at + len(samples), samples.t[-1]
        yield samples
    if not any_complete:
        what = "holds no samples" if at == 0 else "lacks a number in every sample"
        raise RecordingError(f"{name} {what}", "record it again")


def check_units(runs: Iterator[Samples], path: Path) -> Iterator[Samples]:
    """Yield the runs, whose units are SI as far as the samples show it.

    Raises
    ------
    RecordingError : accelerations or rates show another unit.
    """
    seen = dict.fromkeys(("acc", "gyr"), "")
    for samples in runs:
        kept = drop_incomplete(samples)
        if len(kept) >= FEWEST and not all(seen.values()):
            seen["acc"] = seen["acc"] or acceleration_unit(kept.acc)
            seen["gyr"] = seen["gyr"] or gyro_unit(rate_factor(kept.t, kept.acc, kept.gyr))
            if any(seen[key] not in ("", si) for key, si in zip(seen, SI, strict=True)):
                units = ",".join(f"{key}={seen[key] or si}" for key, si in zip(seen, SI, strict=True))
                what = " and ".join(f"{key} in {unit}" for key, unit in seen.items() if unit not in ("", *SI))
                raise RecordingError(
                    f"{path.name} should be in {' and '.join(SI)}, but its values suggest {what}",
                    f"give its units with --units {units}",
                    f"--units {units}",
                )
        yield samples


def cut_span(runs: Iterator[Samples], span: tuple[float, float], name: str) -> Iterator[Samples]:
    """Yield the samples from span[0] to span[1] s after the first.

    Raises
    ------
    RecordingError : there are none.
    """
    origin, some = None, False
    for samples in runs:
        origin = float(samples.t[0]) if origin is None else origin
        first, last = np.searchsorted(samples.t - origin, span)
        if last > first:
            some = True
            yield Samples(**{key: getattr(samples, key)[first:last] for key in SAMPLE_FIELDS})
        if last < len(samples):
            break
    if not some:
        raise RecordingError(f"{name} holds no samples from {span[0]:g} to {span[1]:g} s", "give a --span within it")
