"""Recording files: read whole or a run of samples at a time, and written; `formats` has a row for each format."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..data import Recording
from ..errors import RecordingError
from .formats import find_format, written_format
from .hints import NO_HINTS, Hints
from .reading import limit_memory
from .rows import Rows, Write, arrival_clock, cut_span, drop_incomplete, shown_units, with_times


def load(path: str | Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a file of any format in `formats.FORMATS` (.mcap, .npz, .csv ...), or a session's folder.

    Of a capture that was cut short, the whole part is read, and `recovered` says so. `taken` says how a file of another
    program was read; `hints` give what the file does not say.

    Raises
    ------
    RecordingError : there is no such file, it holds no recording, its units or columns are doubtful, or it needs more
        memory than allowed (see reading).
    UsageError : hints for a file that needs none.
    CaptureError : a capture that cannot be read.
    ChipError : a capture of an unknown chip.
    """
    with limit_memory(Path(path)):
        read = find_format(Path(path), hints).read(Path(path), hints=hints)
    recording = drop_incomplete(read)
    if len(recording) < 2:
        raise RecordingError(f"{read.name} lacks a number in nearly every sample", "record it again")
    if len(recording) < len(read):
        lack = f"{read.name}: {len(read) - len(recording)} samples that lack a number were left out."
        recording = replace(recording, taken=" ".join(filter(None, (read.taken, lack))))
    return recording if hints.span is None else _cut(recording, hints.span)


def open_rows(path: Path, hints: Hints = NO_HINTS) -> Rows:
    """Return the samples of any recording that `load` reads, a run at a time.

    A table in mpucal's own format is read while the runs are consumed, and before that until its units are known. A
    capture is decoded before, since the times of its first samples depend on its last. Any other file is loaded
    whole. A missing number is NaN.

    Raises
    ------
    RecordingError, CaptureError, ChipError : see load; of a bad line or sample only when its run is read.
    """
    with limit_memory(path):
        found = find_format(path, hints)
        rows = found.read_rows(path, hints=hints)
    if rows.plain:
        # read before: its last samples may show the units of its first, and all stamps the clock
        rows = rows.in_si(shown_units(found.read_rows(path, hints=hints).runs, rows.sensor))
        if clock := arrival_clock(found.read_rows(path, hints=hints).runs, rows.sensor):
            taken = " ".join(filter(None, (rows.taken, clock.describe(rows.name))))
            rows = replace(rows, runs=with_times(rows.runs, clock), taken=taken)
    return rows if hints.span is None else replace(rows, runs=cut_span(rows.runs, hints.span, rows.name))


def _cut(recording: Recording, span: tuple[float, float]) -> Recording:
    first, last = np.searchsorted(recording.t - recording.t[0], span)
    if last - first < 2:
        seconds = recording.t[-1] - recording.t[0]
        raise RecordingError(f"{recording.name} lasts {seconds:.1f} s", "give a --span within that")
    return replace(recording.part(first, last), others=tuple(_cut(other, span) for other in recording.others))


def open_writer(path: Path, rows: Rows, done: str) -> AbstractContextManager[Write]:
    """Open a new file in the format of its suffix; it appears whole when the context ends, or not at all.

    Parameters
    ----------
    rows : metadata of the samples. done : the processing of the samples, kept in formats that have a place for it.

    Raises
    ------
    OutputError : no format has this suffix, or the file cannot be written.
    """
    return written_format(path).write(path, rows, done)
