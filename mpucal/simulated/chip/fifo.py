"""FIFO of the chip, with its overflow."""

from __future__ import annotations


class Fifo:
    """Queue that overflows as the chip's does: by bytes, not by frames.

    Parameters
    ----------
    size : in bytes.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._bytes = bytearray()
        self._last = 0

    def __len__(self) -> int:
        return len(self._bytes)

    def push(self, data: bytes, stop_when_full: bool) -> bool:
        """Append `data`; return True if it did not fit, so that the oldest (or the newest) bytes are lost."""
        self._bytes += data
        excess = len(self._bytes) - self.size
        if excess <= 0:
            return False
        if stop_when_full:
            del self._bytes[-excess:]
        else:
            del self._bytes[:excess]
        return True

    def pop(self, count: int) -> bytes:
        """Return the `count` oldest bytes; an empty FIFO repeats the last byte."""
        data = bytes(self._bytes[:count])
        del self._bytes[:count]
        if data:
            self._last = data[-1]
        return data + bytes([self._last]) * (count - len(data))

    def clear(self) -> None:
        """Drop all bytes."""
        self._bytes.clear()
