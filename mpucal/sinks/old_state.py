"""The state of a sink before a write: saved as a JSON file, and restored if the write fails."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import read_limited
from ..disk.atomic import write_atomically
from ..errors import RecordingError, SourceError, WriteBackError
from ..result.calibration import REFUSED, Calibration
from ..result.journal import Journal
from ..result.session_files import SessionFile
from ..strict_json import MOST_BYTES, parse_json


def save_state(file: SessionFile, folder: Path, form: str, where: str, state: Mapping[str, Any]) -> tuple[Path, ...]:
    """Save the state of the sink at `where`; files of earlier states are kept."""
    path = file.free_in(folder)
    document = {"format": form, "version": 1, "where": where, **state}
    write_atomically(path, (json.dumps(document, indent=2) + "\n").encode())
    return (path,)


def load_state(file: SessionFile, path: Path, form: str, *keys: str) -> dict[str, Any]:
    """Return the state that save_state wrote, which has `keys`.

    Raises
    ------
    RecordingError : `path` cannot be read, or holds something else.
    """
    try:
        document = parse_json(read_limited(path, MOST_BYTES))
    except ValueError as error:
        raise not_a_state(file, path, str(error)) from error
    if not isinstance(document, dict) or document.get("format") != form or not document.keys() >= set(keys):
        raise not_a_state(file, path, f"its format is not {form}")
    return document


def not_a_state(file: SessionFile, path: Path, why: str) -> RecordingError:
    """Return the error for a file that does not hold `file.what`."""
    return RecordingError(f"{path} does not hold {file.what} ({why})", f"give a {file.name}")


def check_accepted(calibration: Calibration) -> None:
    """Check that a calibration may be written.

    Raises
    ------
    WriteBackError : it was refused, or D or b_a is not known.
    """
    remedy = "repeat the session, and follow the remedies it gives"
    if calibration.quality.get("verdict") == REFUSED:
        raise WriteBackError("nothing was written: the calibration was refused", remedy)
    if not (np.isfinite(calibration.D).all() and np.isfinite(calibration.b_a).all()):
        raise WriteBackError("nothing was written: the calibration lacks D or b_a", remedy)


@contextmanager
def nothing_written() -> Iterator[None]:
    """Turn a SourceError of the block, which only reads, into a WriteBackError."""
    try:
        yield
    except SourceError as error:
        raise WriteBackError(f"nothing was written: {error.what}", error.remedy) from error


@contextmanager
def restore_on_failure(
    journal: Journal, state: Mapping[str, Any], restore: Callable[[], object], where: str
) -> Iterator[None]:
    """Note the old state in `journal` during the block, and have `restore` write it back if the block fails.

    Parameters
    ----------
    where : the device or the part of it that changes, for messages.

    Raises
    ------
    WriteBackError : for a SourceError of the block or of `restore`.
    """
    journal.begin(state)
    try:
        yield
    except BaseException as error:
        try:
            restore()
        except SourceError as worse:
            what = error.what if isinstance(error, SourceError) else "the write was interrupted"
            raise WriteBackError(f"{what}, and then {worse.what}", worse.remedy) from error
        journal.end()
        if isinstance(error, SourceError):
            raise WriteBackError(f"{error.what}; the old state of {where} is restored", error.remedy) from error
        raise
    journal.end()
