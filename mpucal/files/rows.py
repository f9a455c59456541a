"""Samples in runs, from a file to a file, so that neither has to fit the memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..arguments import measured
from ..data import Autopilot, Recording, Samples, Sensor, Vector
from ..errors import RecordingError

# 16 Ki samples take 1 MB, which fits a cache; a product of more goes to BLAS's threads, and takes longer
ROWS = 1 << 14


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
        whole = Samples.joined(list(self.runs))
        recording = Recording.from_arrays(**vars(whole), flat=self.flat, sensor=self.sensor, name=self.name)
        return replace(
            recording, autopilot=self.autopilot, recovered=self.recovered, utc_ns=self.utc_ns, taken=self.taken
        )


Write = Callable[[Samples], None]


def checked(runs: Iterator[Samples], name: str) -> Iterator[Samples]:
    """The runs, of which is asked what is asked of a Recording's samples.

    Raises
    ------
    RecordingError : there are none; acc, gyr or t is not finite; time does not increase.
    """
    at, last = 0, -np.inf
    for samples in runs:
        for key, values in (("acc", samples.acc), ("gyr", samples.gyr), ("t", samples.t)):
            finite = np.isfinite(values) if key == "t" else measured(values)
            if not finite.all():
                first = at + int(finite.reshape(len(samples), -1).all(axis=1).argmin())
                raise RecordingError(
                    f"{name}: {key} is not a finite number in sample {first}",
                    "leave out what is no number, and keep the times of the others",
                )
        with np.errstate(over="ignore"):
            back = np.diff(samples.t, prepend=last) <= 0
        if back.any():
            raise RecordingError(
                f"{name}: time does not increase at sample {at + int(back.argmax())}",
                "sort the samples by time and drop repeated ones",
            )
        at, last = at + len(samples), samples.t[-1]
        yield samples
    if at == 0:
        raise RecordingError(f"{name} holds no samples", "record it again")


def cannot_read(path: Path, error: OSError) -> RecordingError:
    """What to say of a file that cannot be read."""
    return RecordingError(f"cannot read {path} ({error.strerror or error})", "check the path and its permissions")
