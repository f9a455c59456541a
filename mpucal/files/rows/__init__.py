"""Samples in runs, from a file to a file, so that neither has to fit the memory. Knows no calibration."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...data import Autopilot, Samples, Sensor
from ...errors import OutputError, RecordingError

# 16 Ki samples take 1 MB, which fits a cache; a product of more goes to BLAS's threads, and takes longer
ROWS = 1 << 14


@dataclass(frozen=True)
class Rows:
    """A recording, a run of samples at a time.

    Attributes
    ----------
    runs : each of at most ROWS samples, to be gone through once.
    sensor, flat, autopilot, recovered, name : as of a Recording. others : how many further IMUs it holds.
    done : the sentence that says that the file is calibrated data already; empty where it is not.
    """

    runs: Iterator[Samples]
    sensor: Sensor = field(default_factory=Sensor)
    flat: tuple[int, int] | None = None
    autopilot: Autopilot | None = None
    recovered: str | None = None
    name: str = "recording"
    others: int = 0
    done: str = ""


Write = Callable[[Samples], None]


def open_rows(path: Path) -> Rows:
    """The samples of any recording that `load` reads.

    A table and an archive are read as they are gone through. A capture is gone through before, since the times of its
    first samples are known only with its last. A vehicle's log is decoded whole.

    Raises
    ------
    RecordingError, CaptureError, ChipError : see load; a table's bad line and an odd sample when they are come to.
    """
    if path.is_file() and path.suffix.lower() == ".csv":
        from .csv import csv_rows  # noqa: PLC0415 - each kind's own

        return csv_rows(path)
    if path.is_file() and path.suffix.lower() == ".npz":
        from .npz import npz_rows  # noqa: PLC0415

        return npz_rows(path)
    from .. import captures_of, load  # noqa: PLC0415

    parts = captures_of(path) if path.is_dir() else [path]
    if parts[0].is_file() and parts[0].suffix.lower() == ".mcap":
        from .capture import capture_rows  # noqa: PLC0415

        return capture_rows(parts)
    recording = load(path)
    return Rows(
        (recording.part(first, first + ROWS) for first in range(0, len(recording), ROWS)),
        recording.sensor,
        recording.flat,
        recording.autopilot,
        recording.recovered,
        recording.name,
        len(recording.others),
    )


WRITERS = (".csv", ".npz", ".mcap")


def open_writer(path: Path, rows: Rows, done: str) -> AbstractContextManager[Write]:
    """A new file of the kind that its name ends with, there once its context ends, whole or not at all.

    Parameters
    ----------
    rows : what else is known of the samples. done : what was done to them, which the file then says where it can.

    Raises
    ------
    OutputError : another ending, or the file cannot be made.
    """
    kind = path.suffix.lower()
    if kind == ".csv":
        from .csv import csv_file  # noqa: PLC0415

        return csv_file(path)
    if kind == ".npz":
        from .npz import npz_file  # noqa: PLC0415

        return npz_file(path, rows, done)
    if kind == ".mcap":
        from .imu import imu_file  # noqa: PLC0415

        return imu_file(path, done)
    raise OutputError(f"{path} ends with no kind of file that is written", f"end it with {', '.join(WRITERS)}")


def checked(runs: Iterator[Samples], name: str) -> Iterator[Samples]:
    """The runs, of which is asked what is asked of a Recording's samples.

    Raises
    ------
    RecordingError : there are none; acc, gyr or t is not finite; time does not increase.
    """
    at, last = 0, -np.inf
    for samples in runs:
        for key, values in (("acc", samples.acc), ("gyr", samples.gyr), ("t", samples.t)):
            finite = np.isfinite(values)
            if not finite.all():
                first = at + int(finite.reshape(len(samples), -1).all(axis=1).argmin())
                raise RecordingError(
                    f"{name}: {key} is not a finite number in sample {first}",
                    "leave out what is no number, and keep the times of the others",
                )
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
