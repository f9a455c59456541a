"""A folder of recordings of one sensor, joined into one: a file for each side of the board, or for each turning of it.

The motion between two files is unknown: a gap, long enough to count as an interruption.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from ..data import Recording, Samples, Vector
from ..errors import RecordingError
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE, DOCUMENT
from .hints import NO_HINTS, Hints
from .reading import reading
from .tables.phone import tables_of_sides
from .tables.times import GAP_S

# of files that may be such recordings
SUFFIXES = (".csv", ".txt", ".log", ".tsv", ".npz", ".npy", ".mat", ".parquet", ".json", ".jsonl")
FEWEST, MOST = 2, 500


def is_folder_of_recordings(path: Path) -> bool:
    """Return True if a folder holds several recordings, and no session."""
    return len(_recordings(path)) >= FEWEST


def load_folder_of_recordings(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recordings in a folder as one, in the order of their times of day, or else of their names.

    Raises
    ------
    RecordingError : fewer than two of them can be read.
    """
    from .formats import find_format  # noqa: PLC0415 - its table names this module

    with reading(path):
        files = _recordings(path)
    read: dict[str, Recording] = {}
    failed: dict[str, RecordingError] = {}
    for file in files:
        try:
            read[file.name] = find_format(file, hints).read(file, hints=hints)
        except RecordingError as error:
            failed[file.name] = error
    if len(read) < FEWEST:
        first_error = next(iter(failed.values()))
        what = f"{path.name}: {first_error.what}"
        raise RecordingError(what, first_error.remedy, first_error.options) from first_error
    parts = list(read.values())
    utc_ns = [part.utc_ns for part in parts if part.utc_ns is not None]
    if len(utc_ns) == len(parts):
        parts = sorted(parts, key=lambda part: (part.utc_ns or 0) + part.t[0] * 1e9)
    t: list[Vector] = []
    end = 0.0
    for part in parts:
        since_s = 0.0 if part.utc_ns is None or len(utc_ns) < len(parts) else (part.utc_ns - utc_ns[0]) * 1e-9
        begins = part.t + since_s
        # times of day that overlap cannot be of one sensor's clock
        t.append(
            begins if len(utc_ns) == len(parts) and begins[0] > end else part.t - part.t[0] + end + GAP_S * bool(t)
        )
        end = float(t[-1][-1])
    whole = Samples.joined([replace(part, t=at) for part, at in zip(parts, t, strict=True)])
    starts = np.cumsum([len(part) for part in parts])[:-1]
    arrays = {f.name: getattr(whole, f.name) for f in fields(Samples)}
    arrays["gap"][starts] = True
    first = parts[0]
    taken = (
        f"{path.name} was read as one recording of {len(parts)} files; how the board turned between them is unknown:"
        f" {', '.join(read)}. {first.taken or ''}"
    )
    if failed:
        taken += f" Left out were {', '.join(failed)} ({next(iter(failed.values())).what})."
    return Recording(**arrays, sensor=first.sensor, name=path.name, utc_ns=first.utc_ns, taken=taken.strip())


def _recordings(path: Path) -> list[Path]:
    from .formats import recognise  # noqa: PLC0415

    files = sorted(child for child in path.iterdir() if child.is_file())
    if {file.name for file in files} & {CAPTURE.name, CAPTURE_OF_VEHICLE.name, DOCUMENT.name} or len(files) > MOST:
        return []
    sides = tables_of_sides(file.name for file in files)
    found = [file for file in files if file.name in sides or (not sides and file.suffix.lower() in SUFFIXES)]
    return [file for file in found if (of := recognise(file)) is not None and (of.hinted or file.suffix == ".npz")]
