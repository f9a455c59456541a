"""The .tlog that ground stations write: repeated [8 bytes big-endian, us since 1970] + packet. Knows no message."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Self

from ..errors import CaptureError, OutputError
from .dialect import HEADER, LONGEST, packet_length

STAMP = struct.Struct(">Q")
US = 1_000
# later than any clock, and earlier than nearly all bytes that are no time
LATEST_US = 1 << 52
FLUSH_NS = 500_000_000


class Record(NamedTuple):
    """A packet, and when it was received or sent [ns since 1970, whole us]."""

    t_ns: int
    data: bytes


class TlogWriter:
    """Writes each packet as it comes; a program that is killed loses the last second at most.

    Raises
    ------
    OutputError : the file cannot be created or written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._flushed_ns = 0
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise self._cannot_write(error) from error

    def packet(self, t_ns: int, data: bytes) -> None:
        """Keep a packet."""
        try:
            self._file.write(STAMP.pack(t_ns // US) + data)
            if t_ns - self._flushed_ns >= FLUSH_NS:
                self._file.flush()
                self._flushed_ns = t_ns
        except OSError as error:
            raise self._cannot_write(error) from error

    def close(self) -> None:
        """Write what is left."""
        try:
            self._file.close()
        except OSError as error:
            raise self._cannot_write(error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _cannot_write(self, error: OSError) -> OutputError:
        return OutputError(
            f"cannot write the capture {self._path} ({error.strerror or error})",
            "choose a place that you may write to, with room on it, with -o",
        )


class Tlog(NamedTuple):
    """What a .tlog holds.

    Attributes
    ----------
    records : in the order in which they stand. name : what to call the file.
    recovered : None, or the sentence that says how much of it is damaged.
    """

    records: tuple[Record, ...]
    name: str
    recovered: str | None


def read_tlog(path: Path) -> Tlog:
    """Read a .tlog; what is damaged in it is left out.

    Raises
    ------
    CaptureError : it cannot be read, or holds no packet.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise CaptureError(f"cannot read {path} ({error.strerror})", "check the path and its permissions") from error
    records = tuple(_records(data))
    if not records:
        raise CaptureError(f"{path} holds no MAVLink packet", "give a .tlog that a ground station recorded")
    lost = len(data) - sum(STAMP.size + len(record.data) for record in records)
    recovered = (
        f"{path.name} is cut short or damaged: {lost} of its {len(data)} bytes are no packets." if lost else None
    )
    return Tlog(records, path.name, recovered)


def _records(data: bytes) -> Iterator[Record]:
    at = 0
    while at + STAMP.size < len(data):
        (stamp_us,) = STAMP.unpack_from(data, at)
        begin = at + STAMP.size
        length = packet_length(data[begin : begin + LONGEST]) if data[begin] in HEADER else None
        if stamp_us >= LATEST_US or length is None or begin + length > len(data):
            at += 1
            continue
        yield Record(stamp_us * US, data[begin : begin + length])
        at = begin + length
