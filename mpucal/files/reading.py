"""Reading files: their first bytes, operating system errors as RecordingErrors, and optional libraries."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import RecordingError


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn an OSError of the block into a RecordingError that names `path`."""
    try:
        yield
    except OSError as error:
        raise RecordingError(
            f"cannot read {path} ({error.strerror or error})", "check the path and its permissions"
        ) from error


def first_bytes(path: Path, count: int) -> bytes:
    """Return at most `count` bytes from the beginning of a file; none if it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError:
        return b""


def import_extra(name: str, extra: str, path: Path) -> Any:
    """Import a library that `path` is read with and that an extra of the package installs.

    Raises
    ------
    RecordingError : it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        library = name.partition(".")[0]
        raise RecordingError(
            f"reading {path} needs {library}, which is not installed", f"pip install 'mpucal[{extra}]'"
        ) from error
