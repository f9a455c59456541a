"""A file that is written as what it holds happens: a power cut takes the last second or two."""

from __future__ import annotations

import os
from contextlib import closing, suppress
from pathlib import Path
from threading import Event, Thread
from typing import IO

from ..errors import OutputError
from .atomic import sync_folder
from .location import current_path

EVERY_S = 1.0


class GrowingFile:
    """A file of bytes, made anew, synced once a second; the null device is there already, and keeps nothing.

    Attributes
    ----------
    path : where it is to be. kept : whether it is kept anywhere.

    Raises
    ------
    OutputError : it cannot be made, or is there already.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.kept = path, path != Path(os.devnull)
        self._written = 0
        try:
            # at its end: what another program cut off is not followed by a hole as long as that
            flags = os.O_CREAT | os.O_EXCL | os.O_APPEND if self.kept else 0
            self._file = os.fdopen(os.open(path, os.O_WRONLY | flags | getattr(os, "O_BINARY", 0), 0o666), "wb")
        except OSError as error:
            raise self.failed(error) from error
        sync_folder(path.parent)
        self._syncing = SyncThread(self._file)

    def write(self, data: bytes) -> int:
        """Add to its end; OSError where there is no room."""
        self._written += len(data)
        return self._file.write(data)

    def tell(self) -> int:
        """How many bytes were written."""
        return self._written

    def flush(self) -> None:
        """Give the system what was written."""
        self._file.flush()

    def close(self) -> Path | None:
        """Bring all to the disk and close it; where it then is, None where it is not kept.

        Raises
        ------
        OutputError : it is another one than was written. OSError : there is no room.
        """
        with self._file, closing(self._syncing):
            self.flush()
            if not self.kept:
                return None
            now = current_path(self._file.fileno(), self.path)
            if now is None or os.fstat(self._file.fileno()).st_size != self._written:
                what = "was shortened or overwritten" if now else "was removed or replaced"
                raise OutputError(
                    f"{now or self.path} {what} by another program while it was written", "record it again"
                )
            return now

    def failed(self, error: Exception) -> OutputError:
        """The error of mpucal for an `error` of the operating system while the file grows."""
        return OutputError(
            f"cannot write the capture {self.path} ({getattr(error, 'strerror', None) or error})",
            "choose a place that you may write to, with room on it, with -o",
        )


class SyncThread:
    """Syncs an open file once a second, in a thread of its own: a disk may take as long as it likes."""

    def __init__(self, file: IO[bytes]) -> None:
        self._handle = file.fileno()
        self._closing = Event()
        self._thread = Thread(target=self._sync, name="sync", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Sync for the last time, what was flushed until now included."""
        self._closing.set()
        self._thread.join()
        _sync(self._handle)

    def _sync(self) -> None:
        while not self._closing.wait(EVERY_S):
            _sync(self._handle)


def _sync(handle: int) -> None:
    # a disk that fails shows in the next write
    with suppress(OSError):
        getattr(os, "fdatasync", os.fsync)(handle)
