"""File that is written while its content is recorded: a power cut loses the last second or two."""

from __future__ import annotations

import os
from contextlib import closing, suppress
from pathlib import Path
from threading import Event, Thread
from typing import IO

from ..errors import OutputError
from .atomic import current_path, sync_folder

EVERY_S = 1.0


class GrowingFile:
    """New file of bytes, synced once a second; the null device is accepted too, and keeps nothing.

    Attributes
    ----------
    path : of the file. kept : False for the null device.

    Raises
    ------
    OutputError : the file cannot be created, or exists.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.kept = path, path != Path(os.devnull)
        self._written = 0
        try:
            # Appending leaves no hole if another program shortens the file.
            flags = os.O_CREAT | os.O_EXCL | os.O_APPEND if self.kept else 0
            self._file = os.fdopen(os.open(path, os.O_WRONLY | flags | getattr(os, "O_BINARY", 0), 0o666), "wb")
        except OSError as error:
            raise self.failed(error) from error
        sync_folder(path.parent)
        self._syncing = SyncThread(self._file)

    def write(self, data: bytes) -> int:
        """Append `data`; raise OSError if the disk is full."""
        self._written += len(data)
        return self._file.write(data)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._written

    def flush(self) -> None:
        """Pass the written bytes to the system."""
        self._file.flush()

    def close(self) -> Path | None:
        """Sync and close the file, and return its present path; None for the null device.

        Raises
        ------
        OutputError : another program changed the file. OSError : the disk is full.
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
        """Convert an `error` of the operating system while the file grows."""
        return OutputError(
            f"cannot write the capture {self.path} ({getattr(error, 'strerror', None) or error})",
            "choose another place with -o, with space and permission to write",
        )


class SyncThread:
    """Thread that syncs an open file once a second, so that a slow disk does not delay its writer."""

    def __init__(self, file: IO[bytes]) -> None:
        self._handle = file.fileno()
        self._closing = Event()
        self._thread = Thread(target=self._sync, name="sync", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Sync a last time, with everything flushed so far."""
        self._closing.set()
        self._thread.join()
        _sync(self._handle)

    def _sync(self) -> None:
        while not self._closing.wait(EVERY_S):
            _sync(self._handle)


def _sync(handle: int) -> None:
    # An error of the disk shows in the next write.
    with suppress(OSError):
        getattr(os, "fdatasync", os.fsync)(handle)
