"""The folder of a session, and its captures in their order: the first, and one for each time it was resumed."""

from __future__ import annotations

from pathlib import Path

from ..data import Recording
from ..errors import RecordingError
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE, SessionFile
from . import formats
from .rows import Rows


def captures_in(folder: Path, capture: SessionFile = CAPTURE) -> list[Path]:
    """Return the captures of one kind of session, in order; none if the first is missing."""
    found: list[Path] = []
    while (path := folder / capture.numbered(len(found) + 1)).exists():
        found.append(path)
    return found


def all_captures_in(folder: Path) -> list[Path]:
    """Return the captures of a session of a chip and of one of a vehicle."""
    return [*captures_in(folder), *captures_in(folder, CAPTURE_OF_VEHICLE)]


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
        if captures := captures_in(folder, capture):
            return row, captures
    none = " and ".join(f"no {capture.name}" for capture in captured)
    raise RecordingError(f"the folder {folder} holds {none}", "give the folder of a session, or a recording in it")
