"""Folders: a session's with its captures in order, and one of recordings of one sensor, which are joined into one.

A session has a capture, and one for each time that it was resumed. The recordings are of a side of the board each, or
of one turning of it; the motion between two files is unknown: a gap, long enough to count as an interruption.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import reading
from ..data import Recording, Samples
from ..errors import RecordingError
from ..result.session_files import DOCUMENT, captures_in
from . import formats
from .hints import NO_HINTS, Hints, parse_columns
from .rows import Rows
from .tables.phone import tables_of_sides
from .tables.times import GAP_S

# what is said of a recording whose columns have no names
GUESSED = re.compile(r"(?P<unit>accelerations in [^(,;]+).*guessed from [a-z ]+: --columns (?P<order>[\w,-]+)")
# of files that may be such recordings
SUFFIXES = (*formats.TABLES.split(), ".npz", ".jsonl")
MOST_FILES = 500


def load_folder(folder: Path) -> Recording:
    """Return the recording in a session's captures; see load."""
    row, captures = _find_session(folder)
    return row.read(*captures)


def folder_rows(folder: Path) -> Rows:
    """Return the samples in a session's captures; see open_rows."""
    row, captures = _find_session(folder)
    return row.read_rows(*captures)


def _find_session(folder: Path) -> tuple[formats.Format, list[Path]]:
    captured = {row.session: row for row in formats.FORMATS if row.session}
    for capture, row in captured.items():
        if captures := capture.all_in(folder):
            return row, captures
    none = ", ".join(f"no {capture.name}" for capture in captured)
    remedy, calibration = "give the folder of a session, or a recording", folder / DOCUMENT.name
    if calibration.exists():
        remedy += f"; `{shlex.join(['mpucal', 'show', str(calibration)])}` shows the calibration in it"
    raise RecordingError(f"the folder {folder} holds {none} and no other recording", remedy)


def holds_parts(path: Path) -> bool:
    """Return True if a folder holds recordings, and no session."""
    return len(_recordings(path)) > 0


def load_parts(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recordings in a folder as one, in the order of their times of day, or else of their names.

    Raises
    ------
    RecordingError : fewer than two of several can be read, or the only one cannot.
    """
    with reading(path):
        files = _recordings(path)
    if len(files) == 1:
        return formats.find_format(files[0], hints).read(files[0], hints=hints)
    read, failed = _read_each(files, hints)
    read |= _read_alike([file for file in files if file.name in failed], read, hints)
    read = {file.name: read[file.name] for file in files if file.name in read}
    failed = {name: error for name, error in failed.items() if name not in read}
    if len(read) < 2:
        first_error = next(iter(failed.values()))
        alike = len({error.options for error in failed.values()}) == 1
        one = next(iter(read), "the one file that holds an accelerometer and a gyroscope")
        remedy = first_error.remedy if alike and not read else f"give {one} alone"
        options = first_error.options if alike and not read else ""
        raise RecordingError(f"{path}: {first_error.what}", remedy, options) from first_error
    parts, name = list(read.values()), path.resolve().name
    begins_ns = [(part.utc_ns or 0) + part.t[0] * 1e9 for part in parts]
    known = all(part.utc_ns is not None for part in parts)
    if known:
        parts = [parts[at] for at in np.argsort(begins_ns, kind="stable")]
    joined: list[Samples] = []
    interrupted: list[float] = []
    first, end = parts[0], 0.0
    for part in parts:
        shift = ((part.utc_ns or 0) - (first.utc_ns or 0)) * 1e-9
        # times of day that overlap cannot be of one sensor's clock
        if not known or part.t[0] + shift <= end:
            shift = end + GAP_S * bool(joined) - float(part.t[0])
        joined.append(replace(part, t=part.t + shift))
        end = float(joined[-1].t[-1])
        interrupted += [*(at + shift for at in part.interrupted), end]
    whole = Samples.joined(joined)
    whole.gap[np.cumsum([len(part) for part in parts])[:-1]] = True
    taken = (
        f"{name} was read as one recording of {len(parts)} files; how the board turned between them is unknown:"
        f" {', '.join(read)}. {first.taken or ''}"
    )
    if failed:
        taken += f" Left out were {', '.join(failed)} ({next(iter(failed.values())).what})."
    facts: dict[str, Any] = {"sensor": first.sensor, "name": name, "utc_ns": first.utc_ns, "taken": taken.strip()}
    return Recording(**vars(whole), **facts, interrupted=tuple(interrupted[:-1]))


def _read_each(files: list[Path], hints: Hints) -> tuple[dict[str, Recording], dict[str, RecordingError]]:
    """Return the recordings by the names of their files, and the errors of those that cannot be read."""
    read: dict[str, Recording] = {}
    failed: dict[str, RecordingError] = {}
    for file in files:
        try:
            read[file.name] = formats.find_format(file, hints).read(file, hints=hints)
        except RecordingError as error:
            failed[file.name] = error
    return read, failed


def _read_alike(files: list[Path], read: dict[str, Recording], hints: Hints) -> dict[str, Recording]:
    """Return the recordings in files whose columns were not known, by those of the others, if their unit is the same.

    A side with a large bias does not show its columns by the length of gravity.
    """
    guess = next(filter(None, (GUESSED.search(part.taken or "") for part in read.values())), None)
    if guess is None:
        return {}
    found, _ = _read_each(files, replace(hints, columns=parse_columns(guess["order"])))
    return {name: part for name, part in found.items() if guess["unit"] in (part.taken or "")}


def _recordings(path: Path) -> list[Path]:
    files = sorted(child for child in path.iterdir() if child.is_file())
    if captures_in(path) or (path / DOCUMENT.name).exists() or len(files) > MOST_FILES:
        return []
    sides = tables_of_sides(file.name for file in files)
    found = [file for file in files if file.name in sides or (not sides and file.suffix.lower() in SUFFIXES)]
    return [file for file in found if formats.recognise(file) is not None]
