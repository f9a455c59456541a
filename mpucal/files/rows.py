"""Samples in runs, from a file to a file, so that neither has to fit the memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import measured
from ..data import Autopilot, Mask, Recording, Samples, Sensor, Vector
from ..errors import RecordingError
from .tables.clock import FEWEST, even
from .tables.units import QUANTITIES, acceleration_unit, rate_unit, turned

# 16 Ki samples take 1 MB, which fits a cache; a product of more goes to BLAS's threads, and takes longer
ROWS = 1 << 14
SI = ("m/s^2", "rad/s")
SAMPLE_FIELDS = tuple(f.name for f in fields(Samples))


@dataclass(frozen=True)
class Rows:
    """A recording, a run of samples at a time.

    Attributes
    ----------
    runs : each of at most some ROWS samples, to be gone through once.
    sensor, flat, autopilot, recovered, name, utc_ns, taken : as of a Recording.
    others : how many further IMUs it holds.
    done : the sentence that says that the file is calibrated data already; empty where it is not.
    noise : (2, 3), standard deviations of a sample's acc [m/s^2] and gyr [rad/s]; NaN: unknown.
    plain : whether nothing but a convention says the units, and samples may lack a number (NaN).
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
        """A recording that is in memory."""
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
        """All of it in memory, checked; see Recording.from_arrays."""
        arrays: dict[str, Any] = {**vars(Samples.joined(list(self.runs))), "flat": self.flat}
        arrays, taken = whole(arrays, self.name, self.sensor) if self.plain else (arrays, self.taken)
        recording = Recording.from_arrays(**arrays, sensor=self.sensor, name=self.name, taken=taken)
        return replace(recording, autopilot=self.autopilot, recovered=self.recovered, utc_ns=self.utc_ns)


Write = Callable[[Samples], None]


def whole(arrays: Mapping[str, Any], name: str, sensor: Sensor) -> tuple[dict[str, Any], str | None]:
    """What Recording.from_arrays takes, complete, in SI units and by an even clock, and what was done.

    What is no recording is left as it is, for from_arrays to say.
    """
    made = dict(arrays)
    t, acc, gyr = (np.asarray(arrays[key]) for key in ("t", "acc", "gyr"))
    shapes = (*t.shape, 3), acc.shape, gyr.shape
    if any(each.dtype.kind not in "fiu" for each in (t, acc, gyr)) or len(set(shapes)) > 1 or not len(t):
        return made, None
    said = []
    there = _there(acc, gyr)
    if not there.all() and np.count_nonzero(there) > 1:
        by_sample = {key for key, value in arrays.items() if value is not None and np.shape(value)[:1] == t.shape}
        made |= {key: np.asarray(arrays[key])[there] for key in by_sample - {"flat"}}
        # a gap stands before what follows what was left out
        made["gap"] = _marked(made.get("gap"), np.append(False, ~there[:-1])[there])
        kept, flat = np.append(0, np.cumsum(there)), made.get("flat")
        made["flat"] = flat and (int(kept[flat[0]]), int(kept[flat[1]]))
        said.append(f"{len(t) - len(made['t'])} samples that lack a number were left out")
    with np.errstate(over="ignore", invalid="ignore"):
        t, acc, gyr = (np.asarray(made[key], float) for key in ("t", "acc", "gyr"))
    if len(t) < FEWEST or not np.isfinite(t).all() or (np.diff(t) < 0).any() or not _there(acc, gyr).all():
        return made, None
    fitted = None if sensor.message else even(t)
    if fitted is not None:
        t = fitted.t
        made |= {"t": fitted.t, "gap": _marked(made.get("gap"), fitted.gap)}
        said.append(fitted.said)
    units = (acceleration_unit(acc), rate_unit(turned(t, acc, gyr)))
    for key, unit, si in (("acc", units[0], SI[0]), ("gyr", units[1], SI[1])):
        if unit not in ("", si):
            made[key] = np.asarray(made[key], float) * QUANTITIES[key][unit]
            said.append(f"{key} reads as of {unit}, and was taken as such")
    return made, f"Of {name} {'; '.join(said)}." if said else None


def _marked(gap: Any, more: Mask) -> Mask:
    return more if gap is None else np.asarray(gap, bool) | more


def _there(acc: Vector, gyr: Vector) -> Mask:
    """(n,) whether a sample has all its numbers; an accelerometer alone has no rates at all."""
    rates = measured(gyr).all(axis=1)
    return np.asarray(measured(acc).all(axis=1) & (rates | ~rates.any()))


def complete(samples: Samples) -> Samples:
    """The samples that have all their numbers, and gaps where others were."""
    there = _there(samples.acc, samples.gyr)
    if there.all():
        return samples
    gap = samples.gap | np.append(False, ~there[:-1])
    kept = {key: getattr(samples, key)[there] for key in SAMPLE_FIELDS}
    return Samples(**kept | {"gap": gap[there]})


def checked(runs: Iterator[Samples], name: str) -> Iterator[Samples]:
    """The runs, of which is asked what is asked of a Recording's samples; what is no number becomes NaN.

    Raises
    ------
    RecordingError : there are none; t is not finite, or decreases.
    """
    at, last, any_there = 0, -np.inf, False
    for samples in runs:
        finite = np.isfinite(samples.t)
        if not finite.all():
            raise RecordingError(
                f"{name}: t is not a finite number in sample {at + int(finite.argmin())}",
                "leave out what is no number, and keep the times of the others",
            )
        for values in (samples.acc, samples.gyr):
            values[~measured(values)] = np.nan
        any_there |= bool(_there(samples.acc, samples.gyr).any())
        with np.errstate(over="ignore"):
            back = np.diff(samples.t, prepend=last) < 0
        if back.any():
            raise RecordingError(
                f"{name}: time does not increase at sample {at + int(back.argmax())}",
                "sort the samples by time and drop repeated ones",
            )
        at, last = at + len(samples), samples.t[-1]
        yield samples
    if not any_there:
        what = "holds no samples" if at == 0 else "lacks a number in every sample"
        raise RecordingError(f"{name} {what}", "record it again")


def in_si(runs: Iterator[Samples], path: Path) -> Iterator[Samples]:
    """The runs, which read as of SI units as far as that can be told.

    Raises
    ------
    RecordingError : accelerations or rates read as of another unit.
    """
    seen = dict.fromkeys(("acc", "gyr"), "")
    for samples in runs:
        there = complete(samples)
        if len(there) >= FEWEST and not all(seen.values()):
            seen["acc"] = seen["acc"] or acceleration_unit(there.acc)
            seen["gyr"] = seen["gyr"] or rate_unit(turned(there.t, there.acc, there.gyr))
            if any(seen[key] not in ("", si) for key, si in zip(seen, SI, strict=True)):
                units = ",".join(f"{key}={seen[key] or si}" for key, si in zip(seen, SI, strict=True))
                what = " and ".join(f"{key} as of {unit}" for key, unit in seen.items() if unit not in ("", *SI))
                raise RecordingError(
                    f"{path.name} is said to be in {' and '.join(SI)}, and reads {what}",
                    f"say its units with --units {units}",
                    f"--units {units}",
                )
        yield samples


def spanned(runs: Iterator[Samples], span: tuple[float, float], name: str) -> Iterator[Samples]:
    """The samples from span[0] to span[1] s after the first.

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


def cannot_read(path: Path, error: OSError) -> RecordingError:
    """What to say of a file that cannot be read."""
    return RecordingError(f"cannot read {path} ({error.strerror or error})", "check the path and its permissions")
