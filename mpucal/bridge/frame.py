"""Frames of the serial bridge: COBS, CRC-16 and a zero as delimiter.

See firmware_protocol.md, "Framing".
"""

from __future__ import annotations

import binascii
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

DELIMITER = b"\0"
DELIMITERS = re.compile(rb"\0+")
HEADER = struct.Struct("<B B")
CHECKSUM = struct.Struct("<H")

MAX_PAYLOAD = 66
MAX_CONTENT = HEADER.size + MAX_PAYLOAD + CHECKSUM.size
MAX_ENCODED = MAX_CONTENT + 1


class FrameError(ValueError):
    """Bytes that are not a frame, or a payload that does not fit into one."""


@dataclass(frozen=True)
class Frame:
    """Frame: message type and sequence number, 0..255, and at most MAX_PAYLOAD bytes of payload."""

    type: int
    seq: int
    payload: bytes = b""

    def encode(self) -> bytes:
        """Encode the frame to the bytes on the line, with the delimiter.

        Raises
        ------
        FrameError : the payload is too long.
        """
        if len(self.payload) > MAX_PAYLOAD:
            raise FrameError(f"a payload of {len(self.payload)} bytes is longer than {MAX_PAYLOAD}")
        content = HEADER.pack(self.type, self.seq) + self.payload
        return stuff(content + CHECKSUM.pack(crc16(content))) + DELIMITER

    @classmethod
    def decode(cls, encoded: bytes) -> Frame:
        """Decode the bytes between two delimiters.

        Raises
        ------
        FrameError : too short, too long, not COBS, or damaged.
        """
        if len(encoded) > MAX_ENCODED:
            raise FrameError(f"{len(encoded)} bytes without a zero are longer than a frame")
        content = unstuff(encoded)
        if len(content) < HEADER.size + CHECKSUM.size:
            raise FrameError(f"{len(content)} bytes are too short for a frame")
        body, (crc,) = content[: -CHECKSUM.size], CHECKSUM.unpack(content[-CHECKSUM.size :])
        if crc16(body) != crc:
            raise FrameError("the CRC does not match")
        kind, seq = HEADER.unpack_from(body)
        return cls(kind, seq, body[HEADER.size :])


class Deframer:
    """Splitter of a stream of bytes into frames; other bytes are counted and skipped.

    Attributes
    ----------
    rejected : number of pieces between two delimiters that were not a frame.
    """

    def __init__(self) -> None:
        self._piece = bytearray()
        self.rejected = 0

    def feed(self, data: bytes) -> Iterator[Frame]:
        """Yield the frames that end within `data`; use them up before the next call."""
        *ends, rest = DELIMITERS.split(data)
        for end in ends:
            self._take(end)
            piece = bytes(self._piece)
            self._piece.clear()
            if not piece:
                continue
            try:
                yield Frame.decode(piece)
            except FrameError:
                self.rejected += 1
        self._take(rest)

    def _take(self, data: bytes) -> None:
        # One byte too many is kept, which shows that the piece is not a frame.
        self._piece += data[: MAX_ENCODED + 1 - len(self._piece)]


def crc16(data: bytes) -> int:
    """Return the CRC-16/CCITT-FALSE, which begins with 0xFFFF."""
    return binascii.crc_hqx(data, 0xFFFF)


def stuff(content: bytes) -> bytes:
    """Encode at most 253 bytes by COBS: the result is one byte longer and has no zero."""
    return b"".join(bytes([len(piece) + 1]) + piece for piece in content.split(DELIMITER))


def unstuff(encoded: bytes) -> bytes:
    """Decode COBS bytes, which have no zero: the inverse of `stuff`.

    Raises
    ------
    FrameError : a length byte points beyond the end.
    """
    pieces, at = [], 0
    while at < len(encoded):
        length = encoded[at]
        if at + length > len(encoded):
            raise FrameError("a COBS length points beyond the end")
        pieces.append(encoded[at + 1 : at + length])
        at += length
    return DELIMITER.join(pieces)
