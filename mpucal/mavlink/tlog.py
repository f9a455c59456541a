"""The .tlog format of ground stations: repeated [8 bytes big-endian, us since 1970] + packet."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable, Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import NamedTuple

from ..arguments import reading
from ..clocks import US
from ..errors import CaptureError
from .dialect import BEGINNING, HEADER, LONGEST, packet_length

TLOG = ".tlog"
STAMP = struct.Struct(">Q")
# No clock is later, and nearly all bytes that are not a time are.
LATEST_US = 1 << 52


class RawPacket(NamedTuple):
    """A packet, and when it was received or sent [ns since 1970, whole us]."""

    t_ns: int
    data: bytes


def encode_tlog(packets: Iterable[RawPacket]) -> bytes:
    """Return the content of a .tlog with these packets."""
    return b"".join(STAMP.pack(packet.t_ns // US) + packet.data for packet in packets)


class TlogFile:
    """The packets of a .tlog, read from the file at each iteration; damaged parts are skipped.

    Attributes
    ----------
    name : of the file.
    recovered : None, or the sentence that says how much of it is damaged; set by the end of an iteration.

    Raises
    ------
    CaptureError : in an iteration, if it cannot be read, or holds no packet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.name = path.name
        self.recovered: str | None = None

    def __iter__(self) -> Iterator[RawPacket]:
        whole = size = 0
        with reading(self._path, CaptureError), self._path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            # An empty file cannot be mapped.
            if size:
                with mmap(file.fileno(), 0, access=ACCESS_READ) as data:
                    for record in _records(data):
                        whole += STAMP.size + len(record.data)
                        yield record
        if not whole:
            raise CaptureError(f"{self._path} holds no MAVLink packet", "give a .tlog that a ground station recorded")
        if lost := size - whole:
            self.recovered = f"{self.name} is cut short or damaged: {lost} of its {size} bytes are no packets."


def _records(data: mmap) -> Iterator[RawPacket]:
    at = 0
    while at + STAMP.size < len(data):
        (stamp_us,) = STAMP.unpack_from(data, at)
        begin = at + STAMP.size
        length = packet_length(data[begin : begin + LONGEST]) if data[begin] in HEADER else None
        if stamp_us >= LATEST_US or length is None or begin + length > len(data):
            at = _next_beginning(data, begin + 1) - STAMP.size
            continue
        yield RawPacket(stamp_us * US, data[begin : begin + length])
        at = begin + length


def _next_beginning(data: mmap, begin: int) -> int:
    # Only its position leaves this function: a match object would keep the file mapped.
    found = BEGINNING.search(data, begin)
    return len(data) if found is None else found.start()
