"""Recording files: read whole or a run of samples at a time, and written; `formats` has a row for each format."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

from ..data import Recording
from .budget import within
from .formats import format_of, written_format
from .hints import NO_HINTS, Hints
from .rows import Rows, Write, in_si


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
        return format_of(Path(path), hints).read(Path(path), hints=hints)


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
    return replace(rows, runs=in_si(rows.runs, path)) if rows.plain else rows
