"""How much of a recording is read and held: a file of kilobytes may say, or unpack to, gigabytes.

The limit on memory is $MPUCAL_MOST_MB, or --most-mb. Where a file says beforehand how much it holds it is refused at
once; else Linux enforces the limit while the file is read (RLIMIT_DATA, getrlimit(2)), and gives the memory of the
program back its old limit afterwards.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import RecordingError

MOST_MB, VARIABLE = 512, "MPUCAL_MOST_MB"
# of a file that is held whole, for each byte of memory: a log may hold far more than its IMU
READ = 16
# of memory for a byte of a table of text, whose cells are objects: 6 to 40
HELD = 6
# of a line of text
LONGEST_LINE = 1 << 20
# of a chunk of an MCAP file; mpucal's own are of ten seconds, 2 MB at most
LONGEST_CHUNK = 64 << 20


def most_bytes() -> int:
    """Of memory, beside what the program has already."""
    value = os.environ.get(VARIABLE, "")
    return (int(value) if value.isdecimal() else MOST_MB) << 20


def afford(path: Path, count: int, each: int = 1) -> None:
    """RecordingError where `path` holds more bytes than `each` for each byte of memory."""
    if count > each * most_bytes():
        raise _too_much(path, f"takes {count >> 20} MB")


@contextmanager
def within(path: Path) -> Iterator[None]:
    """What is read of `path` has to fit the memory that it may take.

    Raises
    ------
    RecordingError : it does not.
    """
    with _limited():
        try:
            yield
            return
        except MemoryError:
            pass
    raise _too_much(path, f"takes more than {most_bytes() >> 20} MB of memory")


def _too_much(path: Path, what: str) -> RecordingError:
    megabytes = most_bytes() >> 20
    return RecordingError(
        f"{path} {what}, and {megabytes} MB may be taken", f"allow more with --most-mb, or {VARIABLE}={4 * megabytes}"
    )


@contextmanager
def _limited() -> Iterator[None]:
    """Within, this program's memory grows by what is allowed; where that cannot be asked for, by any amount."""
    before = None
    with suppress(ImportError, OSError, ValueError):
        import resource  # noqa: PLC0415 - not on Windows

        data = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5]) * resource.getpagesize()
        before, hard = resource.getrlimit(resource.RLIMIT_DATA)
        most = min((data + most_bytes(), *(limit for limit in (before, hard) if limit >= 0)))
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
    try:
        yield
    finally:
        if before is not None:
            resource.setrlimit(resource.RLIMIT_DATA, (before, hard))
