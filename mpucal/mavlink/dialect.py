"""pymavlink's messages, imported when they are first used, and a parser that makes packets of bytes."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

from ..errors import UsageError

INSTALL = "pip install 'mpucal[mavlink]'"
# pymavlink has no types: a message is any object with get_type() and the fields of its definition.
Message = Any

V1, V2 = 0xFE, 0xFD
HEADER = {V1: 6, V2: 10}
MAGIC = (bytes([V1]), bytes([V2]))
BEGINNING = re.compile(b"[" + b"".join(MAGIC) + b"]")
CHECKSUM, SIGNATURE = 2, 13
SIGNED = 0x01
FLAGS_AT = 2
LONGEST = HEADER[V2] + 255 + CHECKSUM + SIGNATURE


@cache
def dialect() -> Any:
    """Return the module of all messages that ArduPilot and PX4 send (MAVLink 2).

    Raises
    ------
    UsageError : pymavlink is not installed.
    """
    return import_pymavlink("dialects.v20.ardupilotmega")


def import_pymavlink(name: str) -> Any:
    """Import a module of pymavlink, which is optional: it doubles the installed size of mpucal.

    Raises
    ------
    UsageError : it is not installed.
    """
    try:
        return import_module(f"pymavlink.{name}")
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "pymavlink":
            raise
        raise UsageError("pymavlink, which reads MAVLink, is not installed", INSTALL) from error


class Packet(NamedTuple):
    """The bytes of one message, and the message."""

    data: bytes
    message: Message


def packet_length(data: bytes | bytearray) -> int | None:
    """Return the length of the packet that begins at data[0], or None if there are too few bytes to know it.

    MAVLink serialisation: magic, payload length, (incompatibility flags), ...
    """
    if len(data) <= FLAGS_AT:
        return None
    signature = SIGNATURE if data[0] == V2 and data[FLAGS_AT] & SIGNED else 0
    return HEADER[data[0]] + data[1] + CHECKSUM + signature


def is_packet(data: bytes) -> bool:
    """Return True if `data` has the length of the one packet that it begins with; its checksum is not verified."""
    return data[:1] in MAGIC and packet_length(data) == len(data)


def read_header(packet: bytes) -> tuple[int, tuple[int, int]]:
    """Return message id and (system, component) of the sender of a whole packet; its checksum is not verified."""
    at = HEADER[packet[0]]
    id_bytes = 3 if packet[0] == V2 else 1
    ids_at = at - id_bytes - 2
    return int.from_bytes(packet[at - id_bytes : at], "little"), (packet[ids_at], packet[ids_at + 1])


class Parser:
    """Parser of bytes into whole packets, which skips what is damaged.

    Parameters
    ----------
    mav : pymavlink's MAVLink, which verifies checksums and signatures.

    Attributes
    ----------
    refused : number of packets with a wrong signature.
    """

    def __init__(self, mav: Any) -> None:
        self._mav = mav
        self._buffer = bytearray()
        self.refused = 0

    @property
    def signed_at(self) -> int:
        """Time of the newest signature [10 us since 2015], 0 before the first."""
        return int(self._mav.signing.timestamp)

    def datagram(self, data: bytes) -> list[Packet]:
        """Return the packets of a datagram, which holds whole packets or is damaged."""
        self._buffer = bytearray()
        packets = self.stream(data)
        self._buffer = bytearray()
        return packets

    def stream(self, data: bytes) -> list[Packet]:
        """Return the packets that `data`, the next bytes of a stream, complete."""
        self._buffer += data
        packets: list[Packet] = []
        at = 0
        while (begun := BEGINNING.search(self._buffer, at)) is not None:
            at = begun.start()
            length = packet_length(self._buffer[at : at + HEADER[V2]])
            if length is None or at + length > len(self._buffer):
                break
            packet = self._decode(self._buffer[at : at + length])
            # The byte may only look like a beginning: the true packet may begin within the length it announced.
            at += length if packet else 1
            packets += [packet] if packet else []
        else:
            at = len(self._buffer)
        del self._buffer[:at]
        return packets

    def _decode(self, data: bytearray) -> Packet | None:
        if data[0] == V2 and data[FLAGS_AT] & ~SIGNED:
            return None
        signing = self._mav.signing
        times = dict(signing.stream_timestamps)
        try:
            message = self._mav.decode(data)
        except dialect().MAVError as error:
            # pymavlink remembers a signature's time before it verifies it: a forged one would outdate all true ones.
            signing.stream_timestamps = times
            self.refused += "signature" in str(error)
            return None
        return Packet(bytes(data), message)
