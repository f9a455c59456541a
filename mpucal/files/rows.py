"""Recordings read a run of samples at a time, for files that are larger than memory, and checks of their samples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

import numpy as np

from ..arguments import UNSORTED, is_plausible
from ..clocks.stamps import FEWEST, Clock, are_gaps
from ..data import RUN, Autopilot, Mask, Recording, Samples, Sensor, Vector, clock_of
from ..errors import RecordingError
from .tables.shown_units import acceleration_unit, gyro_unit, rate_factor
from .tables.times import how_often
from .tables.units import QUANTITIES

SI = {"acc": "m/s^2", "gyr": "rad/s"}
# attributes that Rows and Recording share
_KNOWN = ("sensor", "flat", "autopilot", "recovered", "name", "utc_ns", "taken")
S = TypeVar("S", bound=Samples)


@dataclass(frozen=True)
class Rows:
    """A recording as runs of consecutive samples; numbers may be missing (NaN).

    Attributes
    ----------
    runs : of about RUN samples at most; can be iterated once.
    sensor, flat, autopilot, recovered, name, utc_ns, taken : see Recording.
    others : number of further IMUs in the file.
    done : how samples that are calibrated already were processed; empty if they are not calibrated.
    noise : (2, 3) standard deviations of a sample's acc [m/s^2] and gyr [rad/s]; NaN: unknown.
    plain : True if the file does not say in which units it is: SI is the convention, but the values may show others.
    interrupted : see Recording; complete when the runs have been read.
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
    interrupted: list[float] = field(default_factory=list)

    @classmethod
    def of(cls, recording: Recording, done: str = "") -> Rows:
        """Return the rows of a recording in memory."""
        runs = (recording.part(first, first + RUN) for first in range(0, len(recording), RUN))
        known = {key: getattr(recording, key) for key in _KNOWN}
        return cls(runs, **known, others=len(recording.others), done=done, interrupted=[*recording.interrupted])

    def recording(self) -> Recording:
        """Return the whole recording, as of Recording.from_arrays; a `plain` one is converted to SI by its values."""
        samples, remarks = Samples.joined(list(self.runs)), [self.taken, *self.notes()]
        if self.plain and len(samples):
            found = shown_units([samples], self.sensor)
            samples = to_si(samples, found)
            remarks += [describe(self.name, found)]
        taken = " ".join(filter(None, remarks)) or None
        whole = make_recording(**vars(samples), flat=self.flat, sensor=self.sensor, name=self.name, taken=taken)
        known = {key: getattr(self, key) for key in ("autopilot", "recovered", "utc_ns")}
        return replace(whole, **known, interrupted=tuple(self.interrupted))

    def in_si(self, units: Mapping[str, str]) -> Self:
        """Return the rows, converted from `units` to SI, and with a sentence on these units in `taken`."""
        taken = " ".join(filter(None, (self.taken, describe(self.name, units)))) or None
        return replace(self, runs=(to_si(samples, units) for samples in self.runs), taken=taken)

    def notes(self) -> list[str]:
        """Return sentences on the samples; call it when the runs have been read."""
        remarks = [f"{describe_done(self.name, self.done)}."] if self.done else []
        if self.plain and self.interrupted:
            remarks += [
                f"{self.name}: its times restart {how_often(len(self.interrupted))}, and continue there after a gap."
            ]
        return remarks


Write = Callable[[Samples], None]


def make_recording(*, acc: Any, gyr: Any, **others: Any) -> Recording:
    """Return Recording.from_arrays of arrays in which numbers may be missing (NaN)."""
    recording = Recording.from_arrays(acc=np.nan_to_num(acc), gyr=np.nan_to_num(gyr), **others)
    return replace(recording, acc=np.asarray(acc, float), gyr=np.asarray(gyr, float))


def describe_done(name: str, done: str) -> str:
    """Return a clause on samples that are calibrated already."""
    return f"{name} is calibrated already ({done}): a new calibration is of the errors that are left"


def describe(name: str, units: Mapping[str, str]) -> str:
    """Return a sentence on units that are not SI; empty if all are."""
    listed = "; ".join(f"{key} was read in {unit}, which its values suggest" for key, unit in units.items() if unit)
    return f"{name}: {listed}." if listed else ""


def arrival_clock(runs: Iterator[Samples], sensor: Sensor) -> Clock | None:
    """Return the clock with which the samples were taken, if the first run's times are of arrival; otherwise None."""
    first = next(runs, None)
    if first is None or not clock_of(first.t, sensor).jitter_s:
        return None
    return clock_of(np.concatenate([first.t, *(samples.t for samples in runs)]), sensor)


def with_times(runs: Iterable[Samples], clock: Clock) -> Iterator[Samples]:
    """Yield the samples of all runs with the times of their clock."""
    at = 0
    for samples in runs:
        part = slice(at, at := at + len(samples))
        yield replace(samples, t=clock.t[part], gap=samples.gap | clock.gap[part])


def shown_units(runs: Iterable[Samples], sensor: Sensor) -> dict[str, str]:
    """Return the units of `acc` and `gyr` by their values, in the first run that shows them; SI units are left out."""
    seen = dict.fromkeys(SI, "")
    for samples in runs:
        kept = drop_incomplete(samples)
        if len(kept) >= FEWEST:
            t = clock_of(kept.t, sensor).t
            seen["acc"] = seen["acc"] or acceleration_unit(kept.acc)
            seen["gyr"] = seen["gyr"] or gyro_unit(rate_factor(t, kept.acc, kept.gyr))
        if all(seen.values()):
            break
    return {key: unit for key, unit in seen.items() if unit != SI[key]}


def to_si(samples: S, units: Mapping[str, str]) -> S:
    """Return samples, converted from `units` to SI."""
    return replace(samples, **{key: getattr(samples, key) * QUANTITIES[key][of] for key, of in units.items() if of})


def is_complete(acc: Vector, gyr: Vector) -> Mask:
    """Return (n,) True where a sample has all its numbers: three accelerations, and three rates or none."""
    rates = is_plausible(gyr).all(axis=1)
    return np.asarray(is_plausible(acc).all(axis=1) & (rates | ~rates.any()))


def drop_incomplete(samples: S) -> S:
    """Return the samples that have all their numbers, with a gap where several in a row are dropped."""
    complete = is_complete(samples.acc, samples.gyr)
    if complete.all():
        return samples
    at = np.flatnonzero(complete)
    # A gap before a dropped sample is one before the next sample that is kept.
    gaps = np.cumsum(samples.gap)[at]
    gap = (np.diff(gaps, prepend=0) > 0) | are_gaps(at)
    kept: dict[str, Any] = vars(samples.at(at)) | {"gap": gap}
    if isinstance(samples, Recording) and samples.flat is not None:
        kept["flat"] = tuple(np.searchsorted(at, samples.flat).tolist())
    return replace(samples, **kept)


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
        any_complete |= bool(is_complete(samples.acc, samples.gyr).any())
        with np.errstate(over="ignore"):
            back = np.diff(samples.t, prepend=last) < 0
        if back.any():
            raise RecordingError(
                f"{name}: time does not increase at sample {at + int(back.argmax())}",
                UNSORTED,
            )
        at, last = at + len(samples), samples.t[-1]
        yield samples
    if not any_complete:
        what = "holds no samples" if at == 0 else "lacks a number in every sample"
        raise RecordingError(f"{name} {what}", "record it again")


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
            yield samples.at(slice(first, last))
        if last < len(samples):
            break
    if not some:
        raise RecordingError(f"{name} holds no samples from {span[0]:g} to {span[1]:g} s", "give a --span within it")
