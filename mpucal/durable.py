"""Bytes of a growing file on their way to the disk: a power cut takes the last second or two."""

from __future__ import annotations

import os
from contextlib import suppress
from threading import Event, Thread
from typing import IO

EVERY_S = 1.0


class Durable:
    """Syncs an open file once a second, in a thread of its own: a disk may take as long as it likes.

    Parameters
    ----------
    file : open for writing; it is flushed by its writer, and closed after `close`.
    """

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
    # a pipe, /dev/null: nothing to keep; a disk that fails shows in the next write
    with suppress(OSError):
        getattr(os, "fdatasync", os.fsync)(handle)
