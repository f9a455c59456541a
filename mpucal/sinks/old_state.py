"""The state of a sink before a write: saved as a JSON file, and restored if the write fails or is interrupted."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from ..arguments import read_limited
from ..disk.atomic import write_atomically
from ..errors import RecordingError, SourceError, WriteBackError
from ..result.calibration import Calibration
from ..result.journal import Journal
from ..result.session_files import SessionFile
from ..strict_json import MOST_BYTES, parse_json

# signals that are handled as Ctrl-C during a write, and the handlers that they may have
NAMES = ("SIGTERM", "SIGHUP")
REPLACED = (signal.SIG_DFL, signal.default_int_handler)


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
    if calibration.objection:
        remedy = "repeat the session, and follow the remedies it gives"
        raise WriteBackError(f"nothing was written: {calibration.objection}", remedy)


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


@contextmanager
def interrupting() -> Iterator[None]:
    """Raise KeyboardInterrupt in the block at the first of these signals; later ones do not disturb the restoring."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ended = False

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal ended
        if not ended:
            ended = True
            raise KeyboardInterrupt

    # Windows has no SIGHUP; a signal that has another handler keeps it
    numbers = [
        number for name in NAMES if (number := getattr(signal, name, None)) and signal.getsignal(number) in REPLACED
    ]
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
