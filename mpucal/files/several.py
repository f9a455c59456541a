"""Recordings of one sensor in a folder, one after the other: a file for each face, or for each time it was turned.

How the board was turned between two files nobody knows: a gap, long enough for an interruption.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from ..data import Recording, Samples, Vector
from ..errors import RecordingError
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE, DOCUMENT
from .hints import NO_HINTS, Hints
from .rows import cannot_read

# of the names of files that may be such recordings, but for those of sessions
SUFFIXES = (".csv", ".txt", ".log", ".tsv", ".npz", ".npy", ".mat", ".parquet")
FEWEST, MOST = 2, 500
# s between two files whose times of day nobody noted: longer than what a bus loses
APART_S = 15.0


def is_folder_of_recordings(path: Path) -> bool:
    """Whether a folder holds several recordings, and no session."""
    return len(_recordings(path)) >= FEWEST


def load_folder_of_recordings(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """The recordings in a folder as one, in the order of their times of day, or else of their names.

    Raises
    ------
    RecordingError : one of them cannot be read.
    """
    from .formats import format_of  # noqa: PLC0415 - which has a row of this

    try:
        files = _recordings(path)
    except OSError as error:
        raise cannot_read(path, error) from error
    try:
        parts = [format_of(file, hints).read(file, hints=hints) for file in files]
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error.what}", error.remedy, error.options) from error
    utc_ns = [part.utc_ns for part in parts if part.utc_ns is not None]
    if len(utc_ns) == len(parts):
        parts = sorted(parts, key=lambda part: (part.utc_ns or 0) + part.t[0] * 1e9)
    t: list[Vector] = []
    end = 0.0
    for part in parts:
        since_s = 0.0 if part.utc_ns is None or len(utc_ns) < len(parts) else (part.utc_ns - utc_ns[0]) * 1e-9
        begins = part.t + since_s
        # one that overlaps the one before cannot be of the same sensor's time
        t.append(
            begins if len(utc_ns) == len(parts) and begins[0] > end else part.t - part.t[0] + end + APART_S * bool(t)
        )
        end = float(t[-1][-1])
    whole = Samples.joined([replace(part, t=at) for part, at in zip(parts, t, strict=True)])
    starts = np.cumsum([len(part) for part in parts])[:-1]
    arrays = {f.name: getattr(whole, f.name) for f in fields(Samples)}
    arrays["gap"][starts] = True
    first = parts[0]
    said = f"Of {path.name} {len(parts)} files were taken as one recording, of which nobody knows how it was turned"
    said += f" between them: {', '.join(file.name for file in files)}."
    return Recording(
        **arrays, sensor=first.sensor, name=path.name, utc_ns=first.utc_ns, taken=f"{said} {first.taken or ''}".strip()
    )


def _recordings(path: Path) -> list[Path]:
    from .formats import recognised  # noqa: PLC0415

    files = sorted(child for child in path.iterdir() if child.is_file())
    if {file.name for file in files} & {CAPTURE.name, CAPTURE_OF_VEHICLE.name, DOCUMENT.name} or len(files) > MOST:
        return []
    found = [file for file in files if file.suffix.lower() in SUFFIXES]
    return [file for file in found if (of := recognised(file)) is not None and (of.hinted or file.suffix == ".npz")]
