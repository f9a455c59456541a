"""Reading of files within limits of memory, since a file of kilobytes may claim, or unpack to, gigabytes.

The limit is $MPUCAL_MOST_MB, or --most-mb. A file that states too large a size is refused at once. Otherwise Linux
enforces the limit while the file is read (RLIMIT_DATA, getrlimit(2)). That limits the whole process: where it has other
threads, it is not done unless $MPUCAL_MOST_MB is set, as the command line does.
"""

from __future__ import annotations

import lzma
import os
import threading
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from ..arguments import reading
from ..errors import MpucalError, RecordingError

MOST_MB = 512
VARIABLE = "MPUCAL_MOST_MB"
# bytes of a file for each allowed byte of memory: a log may hold far more than its IMU
FILE_PER_MEMORY = 16
# bytes of memory for a byte of a table of text, whose cells are objects: 6 to 40
MEMORY_PER_TEXT = 6
# bytes of a line of text
LONGEST_LINE = 1 << 20
# bytes of a chunk of an MCAP file; those of mpucal hold ten seconds, 2 MB at most
LONGEST_CHUNK = 64 << 20
# bytes from the beginning of a file by which its format is recognised
SNIFFED = 1 << 16
# the share of NUL bytes beyond which a file is binary, of words beyond which a column is no clock, and of empty lines
# beyond which these are another sensor's, and of unlike bytes beyond which a record has another size
MOST_ODD = 0.1
# errors of zipfile and its decompressors; RuntimeError includes NotImplementedError, of an unknown compression
DAMAGED_ZIP = (zipfile.BadZipFile, RuntimeError, EOFError, ValueError, zlib.error, lzma.LZMAError)
_ONE = threading.RLock()


def allowed_bytes() -> int:
    """Return the bytes of memory that a recording may take."""
    value = os.environ.get(VARIABLE, "")
    return (int(value) if value.isdecimal() else MOST_MB) << 20


def check_size(path: Path, count: int, each: int = 1) -> None:
    """Raise RecordingError if `path` holds more than `each` bytes for each allowed byte of memory."""
    if count > each * allowed_bytes():
        raise _too_much(path, f"takes {count >> 20} MB")


def _too_much(path: Path, what: str) -> RecordingError:
    megabytes = allowed_bytes() >> 20
    return RecordingError(
        f"{path} {what}, but only {megabytes} MB are allowed",
        f"allow more with --most-mb, or {VARIABLE}={4 * megabytes}",
    )


@contextmanager
def limit_memory(path: Path) -> Iterator[None]:
    """Limit the memory that the block takes to read `path`; see above.

    Raises
    ------
    RecordingError : it needs more.
    """
    with _limited() if VARIABLE in os.environ or threading.active_count() == 1 else nullcontext():
        try:
            yield
            return
        except MemoryError:
            pass
    raise _too_much(path, f"takes more than {allowed_bytes() >> 20} MB of memory")


@contextmanager
def _limited() -> Iterator[None]:
    """Limit the growth of this process within the block, where the system can do that; one block at a time."""
    with _ONE, ExitStack() as stack:
        with suppress(ImportError, OSError, ValueError):
            import resource  # noqa: PLC0415 - not on Windows

            data = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5]) * resource.getpagesize()
            before, hard = resource.getrlimit(resource.RLIMIT_DATA)
            most = min((data + allowed_bytes(), *(limit for limit in (before, hard) if limit >= 0)))
            resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
            stack.callback(resource.setrlimit, resource.RLIMIT_DATA, (before, hard))
        yield


@contextmanager
def whole(path: Path, what: str, remedy: str, errors: tuple[type[Exception], ...]) -> Iterator[None]:
    """Turn an OSError or one of `errors` of the block, but mpucal's own, into a RecordingError that names `path`."""
    try:
        with reading(path):
            yield
    except MpucalError:
        raise
    except errors as error:
        raise RecordingError(f"{path} is not a whole {what} ({error})", remedy) from error


def first_bytes(path: Path, count: int = SNIFFED) -> bytes:
    """Return at most `count` bytes from the beginning of a file; none if it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError:
        return b""


def is_text(data: bytes) -> bool:
    """Return True if bytes seem to be text, and no workbook of Excel; a logger that is switched off leaves zeros."""
    return len(data) > 0 and not data.startswith(b"PK\3\4") and data.count(b"\0") <= MOST_ODD * len(data)


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
