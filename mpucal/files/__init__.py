"""Recording files: read whole or a run of samples at a time, and written; `formats` has a row for each format."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..data import Recording
from ..errors import RecordingError
from .budget import within
from .formats import format_of, written_format
from .hints import NO_HINTS, Hints
from .rows import Rows, Write, in_si, spanned


def load(path: str | Path, hints: Hints = NO_HINTS) -> Recording:
    """The recording in a file of any format in `formats.FORMATS` (.mcap, .npz, .csv ...), or in a session's folder.

    A capture that was cut short gives what is whole of it, and says so in `recovered`. What a file of another program
    was taken for is said in `taken`; `hints` say what it does not.

    Raises
    ------
    RecordingError : no such file, one of another kind, no recording in it, doubtful units or columns, or more than may
        be held (see budget).
    UsageError : hints for a file that needs none.
    CaptureError : a capture that cannot be read.
    ChipError : the capture of a chip that is not known.
    """
    with within(Path(path)):
        recording = format_of(Path(path), hints).read(Path(path), hints=hints)
    return recording if hints.span is None else _cut(recording, hints.span)


def open_rows(path: Path, hints: Hints = NO_HINTS) -> Rows:
    """The samples of any recording that `load` reads, a run at a time.

    A table and an archive are read as they are gone through. A capture is gone through before, since the times of its
    first samples are known only with its last. A vehicle's log is decoded whole. Samples of a table or an archive that
    lack a number are among them, as NaN.

    Raises
    ------
    RecordingError, CaptureError, ChipError : see load; a table's bad line and an odd sample when they are come to.
    """
    with within(path):
        rows = format_of(path, hints).read_rows(path, hints=hints)
    rows = replace(rows, runs=in_si(rows.runs, path)) if rows.plain else rows
    return rows if hints.span is None else replace(rows, runs=spanned(rows.runs, hints.span, rows.name))


def _cut(recording: Recording, span: tuple[float, float]) -> Recording:
    first, last = np.searchsorted(recording.t - recording.t[0], span)
    if last - first < 2:
        seconds = recording.t[-1] - recording.t[0]
        raise RecordingError(f"{recording.name} lasts {seconds:.1f} s", "give a --span that lies within it")
    return replace(recording.part(first, last), others=tuple(_cut(other, span) for other in recording.others))


def open_writer(path: Path, rows: Rows, done: str) -> AbstractContextManager[Write]:
    """A new file in the format that its suffix names, there once its context ends, whole or not at all.

    Parameters
    ----------
    rows : what else is known of the samples. done : what was done to them, which the file then says where it can.

    Raises
    ------
    OutputError : another suffix, or the file cannot be made.
    """
    return written_format(path).write(path, rows, done)
