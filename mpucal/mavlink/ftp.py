"""Files in a vehicle's storage, moved whole by MAVLink FTP (FILE_TRANSFER_PROTOCOL, 110).

Payload: sequence u16, session u8, opcode u8, size u8, requested opcode u8, burst u8, padding, offset u32, data.
Sizes and checksums that vehicles report are not trusted: every file is read back. docs/architecture.md says why this
is not pymavlink's mavftp.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, Self

from ..errors import LinkError
from .dialect import Message, dialect
from .link import Link
from .requests import ask

PAYLOAD, MOST_DATA = 251, 239
TIMEOUT_S, TRIES = 0.5, 10
SEQUENCE = 1 << 16
LARGEST = 1 << 20


class Opcode(IntEnum):
    """Requests, and the two kinds of reply."""

    TERMINATE = 1
    RESET = 2
    OPEN_TO_READ = 4
    READ = 5
    CREATE = 6
    WRITE = 7
    REMOVE = 8
    ACK = 128
    NAK = 129


class ErrorCode(IntEnum):
    """The first byte of a NAK's data."""

    FAIL = 1
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    NOT_FOUND = 10


NAK_WORDS = {
    bytes([ErrorCode.UNKNOWN_COMMAND]): "it does not know MAVLink FTP, or has it turned off",
    bytes([ErrorCode.NOT_FOUND]): "there is no such file or folder, and perhaps no card",
}


@dataclass(frozen=True)
class Payload:
    """Payload of a FILE_TRANSFER_PROTOCOL."""

    sequence: int
    session: int
    opcode: int
    data: bytes = b""
    offset: int = 0
    size: int | None = None
    requested: int = 0

    HEADER: ClassVar = struct.Struct("<HBBBBBxI")

    def encode(self) -> bytes:
        """Return the PAYLOAD bytes."""
        size = len(self.data) if self.size is None else self.size
        head = self.HEADER.pack(self.sequence, self.session, self.opcode, size, self.requested, 0, self.offset)
        return (head + self.data).ljust(PAYLOAD, b"\0")

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode at least a header's bytes; `data` has the length that `size` says."""
        sequence, session, opcode, size, requested, _, offset = cls.HEADER.unpack(payload[: cls.HEADER.size])
        data = payload[cls.HEADER.size : cls.HEADER.size + size]
        return cls(sequence, session, opcode, data, offset, size, requested)


class Storage:
    """Storage of the vehicle that `link` is locked to."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._sequence = 0

    def put(self, path: str, data: bytes) -> None:
        """Write a file, and read it back.

        Raises
        ------
        LinkError : the vehicle does not take it, or another file is read back.
        """
        self._request(path, Opcode.RESET)
        session = self._request(path, Opcode.CREATE, path.encode()).session
        for at in range(0, len(data), MOST_DATA):
            self._request(path, Opcode.WRITE, data[at : at + MOST_DATA], session, at)
        self._request(path, Opcode.TERMINATE, session=session)
        if self.get(path) != data:
            raise LinkError(f"{self._link.vehicle} holds another {path} than was sent", "check its card")

    def get(self, path: str) -> bytes:
        """Read a file.

        Raises
        ------
        LinkError : it does not exist, or cannot be read.
        """
        session = self._request(path, Opcode.OPEN_TO_READ, path.encode()).session
        data = b""
        while len(data) < LARGEST:
            reply = self._ask(Opcode.READ, b"", session, len(data), size=MOST_DATA)
            if reply is not None and reply.opcode == Opcode.NAK and reply.data[:1] == bytes([ErrorCode.END_OF_FILE]):
                break
            part = self._acknowledged(path, reply).data
            if not part:
                break
            data += part
        self._request(path, Opcode.TERMINATE, session=session)
        return data

    def remove(self, path: str) -> None:
        """Remove a file.

        Raises
        ------
        LinkError : it cannot be removed.
        """
        self._request(path, Opcode.REMOVE, path.encode())

    def _request(self, path: str, opcode: Opcode, data: bytes = b"", session: int = 0, offset: int = 0) -> Payload:
        return self._acknowledged(path, self._ask(opcode, data, session, offset))

    def _ask(self, opcode: Opcode, data: bytes, session: int, offset: int, size: int | None = None) -> Payload | None:
        self._sequence = (self._sequence + 1) % SEQUENCE
        asked = Payload(self._sequence, session, opcode, data, offset, size)
        vehicle = self._link.vehicle
        message = dialect().MAVLink_file_transfer_protocol_message(
            0, vehicle.system, vehicle.component, bytearray(asked.encode())
        )

        def reply(received: Message) -> Payload | None:
            if received.get_type() != "FILE_TRANSFER_PROTOCOL":
                return None
            answer = Payload.decode(bytes(received.payload))
            # A reply's number follows its request's, which may have been sent twice.
            same = (answer.sequence - asked.sequence) % SEQUENCE == 1 and answer.requested == opcode
            return answer if same else None

        return ask(self._link, message, reply, TIMEOUT_S, TRIES)

    def _acknowledged(self, path: str, reply: Payload | None) -> Payload:
        if reply is not None and reply.opcode == Opcode.ACK:
            return reply
        why = "it does not answer" if reply is None else NAK_WORDS.get(reply.data[:1], "it failed")
        raise LinkError(
            f"{self._link.vehicle} does not keep {path} in its storage ({why})", "put a card into it, or omit --store"
        )
