"""Messages of the serial bridge: payloads to values and back.

See firmware_protocol.md, "Messages"; each class is the table of its name there.
"""

from __future__ import annotations

import struct
from dataclasses import astuple, dataclass
from enum import IntEnum, IntFlag
from typing import ClassVar, Self

MAGIC = b"MPUB"
MAJOR, MINOR = 1, 0
REPLY_BIT = 0x80

MAX_READ = 56
MAX_WRITE = 32
MAX_BURST = 4096
MAX_CHUNK = 32
MAX_LOOK = 73
MAX_BATCH = 32
MIN_WINDOW = 2


class MessageError(ValueError):
    """A payload that is not of its message's form, or values that do not fit it."""


class Status(IntEnum):
    """Whether a request was done; see "Status codes"."""

    OK = 0
    NO_HELLO = 1
    UNKNOWN_TYPE = 2
    BAD_PAYLOAD = 3
    BAD_VERSION = 4
    NO_ANSWER = 5
    BUS_FAILED = 6
    OVERFLOW = 7
    NO_BLOB = 8
    BAD_BLOB = 9
    BAD_OFFSET = 10
    NO_ROOM = 11
    NOT_BEGUN = 12
    STORAGE_FAILED = 13


class Feature(IntFlag):
    """What a bridge has besides register access; OCCUPIED: storing overwrites what is not a blob."""

    STREAM = 1
    BLOB = 2
    LEAVE = 4
    OCCUPIED = 8


class Message:
    """What all messages have: the fixed fields in FORMAT's order, then the bytes of TAIL, if it has some."""

    TYPE: ClassVar[int]
    FORMAT: ClassVar[struct.Struct]
    TAIL: ClassVar[bool] = False

    def payload(self) -> bytes:
        """The payload's bytes.

        Raises
        ------
        MessageError : a value does not fit its field.
        """
        values = list(astuple(self))  # type: ignore[call-overload]
        tail = values.pop() if self.TAIL else b""
        try:
            return self.FORMAT.pack(*values) + bytes(tail)
        except struct.error as error:
            raise MessageError(f"a value of {type(self).__name__} does not fit its field ({error})") from error

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """The values of a payload; fields that a newer minor version appended are skipped.

        Raises
        ------
        MessageError : it is too short.
        """
        size = cls.FORMAT.size
        if len(payload) < size:
            raise MessageError(f"{len(payload)} bytes are too short for {cls.__name__}, {size} or more")
        tail = (payload[size:],) if cls.TAIL else ()
        return cls(*cls.FORMAT.unpack_from(payload), *tail)


@dataclass(frozen=True)
class Hello(Message):
    """Who is there; `address` 0 lets the bridge try both."""

    TYPE: ClassVar[int] = 0x01
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<4s B B B")
    magic: bytes = MAGIC
    major: int = MAJOR
    minor: int = MINOR
    address: int = 0


@dataclass(frozen=True)
class Read(Message):
    """Read `count` registers from `register` on."""

    TYPE: ClassVar[int] = 0x02
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B B")
    register: int
    count: int


@dataclass(frozen=True)
class Burst(Message):
    """Read `count` bytes from a register that does not auto-increment."""

    TYPE: ClassVar[int] = 0x03
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B H")
    register: int
    count: int


@dataclass(frozen=True)
class Write(Message):
    """Write `data` from `register` on."""

    TYPE: ClassVar[int] = 0x04
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B")
    TAIL: ClassVar[bool] = True
    register: int
    data: bytes


@dataclass(frozen=True)
class Stream(Message):
    """Push frames of `frame_bytes` from the FIFO, `batch` or more at a time; 0 stops it."""

    TYPE: ClassVar[int] = 0x05
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B B")
    frame_bytes: int
    batch: int


@dataclass(frozen=True)
class Leave(Message):
    """End the program, which somebody started from a REPL."""

    TYPE: ClassVar[int] = 0x06
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<")


@dataclass(frozen=True)
class BlobState(Message):
    """Which blob is stored, and is it valid."""

    TYPE: ClassVar[int] = 0x10
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<")


@dataclass(frozen=True)
class BlobRead(Message):
    """Read `count` bytes of the stored blob."""

    TYPE: ClassVar[int] = 0x11
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<H B")
    offset: int
    count: int


@dataclass(frozen=True)
class BlobBegin(Message):
    """A blob of `length` bytes comes."""

    TYPE: ClassVar[int] = 0x12
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<H")
    length: int


@dataclass(frozen=True)
class BlobData(Message):
    """Some of its bytes."""

    TYPE: ClassVar[int] = 0x13
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<H")
    TAIL: ClassVar[bool] = True
    offset: int
    data: bytes


@dataclass(frozen=True)
class BlobCommit(Message):
    """That was all; `crc` is its CRC-32."""

    TYPE: ClassVar[int] = 0x14
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<H I")
    length: int
    crc: int


@dataclass(frozen=True)
class BlobErase(Message):
    """Store none."""

    TYPE: ClassVar[int] = 0x15
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<")


@dataclass(frozen=True)
class Reply(Message):
    """What every message of a bridge begins with, and where it failed may end with.

    `t_us`: the bridge's clock, modulo 2**32, when the transfer began or the request was handled.
    """

    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B I")
    status: int
    t_us: int


@dataclass(frozen=True)
class HelloReply(Reply):
    """The bridge: its version, the chip's address (0: none answers), what it has and can hold."""

    TYPE: ClassVar[int] = Hello.TYPE | REPLY_BIT
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B I 4s B B B B B H 16s")
    magic: bytes
    major: int
    minor: int
    address: int
    features: int
    window: int
    blob_bytes: int
    name: bytes


@dataclass(frozen=True)
class ReadReply(Reply):
    """The bytes read."""

    TYPE: ClassVar[int] = Read.TYPE | REPLY_BIT
    TAIL: ClassVar[bool] = True
    data: bytes


@dataclass(frozen=True)
class BurstReply(Reply):
    """Bytes from `offset` on of those asked for."""

    TYPE: ClassVar[int] = Burst.TYPE | REPLY_BIT
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B I H")
    TAIL: ClassVar[bool] = True
    offset: int
    data: bytes


@dataclass(frozen=True)
class WriteReply(Reply):
    """Written."""

    TYPE: ClassVar[int] = Write.TYPE | REPLY_BIT


@dataclass(frozen=True)
class StreamReply(Reply):
    """The stream began or stopped."""

    TYPE: ClassVar[int] = Stream.TYPE | REPLY_BIT


@dataclass(frozen=True)
class LeaveReply(Reply):
    """The program ends."""

    TYPE: ClassVar[int] = Leave.TYPE | REPLY_BIT


@dataclass(frozen=True)
class BlobStateReply(Reply):
    """The stored blob, which the bridge has just checked."""

    TYPE: ClassVar[int] = BlobState.TYPE | REPLY_BIT
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B I I H I")
    generation: int
    length: int
    crc: int


@dataclass(frozen=True)
class BlobReadReply(Reply):
    """Bytes of the stored blob."""

    TYPE: ClassVar[int] = BlobRead.TYPE | REPLY_BIT
    TAIL: ClassVar[bool] = True
    data: bytes


@dataclass(frozen=True)
class BlobBeginReply(Reply):
    """Begun."""

    TYPE: ClassVar[int] = BlobBegin.TYPE | REPLY_BIT


@dataclass(frozen=True)
class BlobDataReply(Reply):
    """Written to the slot that is not in use."""

    TYPE: ClassVar[int] = BlobData.TYPE | REPLY_BIT


@dataclass(frozen=True)
class BlobCommitReply(Reply):
    """The new blob is the valid one."""

    TYPE: ClassVar[int] = BlobCommit.TYPE | REPLY_BIT
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B I I")
    generation: int


@dataclass(frozen=True)
class BlobEraseReply(Reply):
    """None is stored."""

    TYPE: ClassVar[int] = BlobErase.TYPE | REPLY_BIT


@dataclass(frozen=True)
class Frames(Reply):
    """What was in the FIFO: `left` frames that were counted at `t_us` follow, or status says why it stands."""

    TYPE: ClassVar[int] = 0xC0
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<B I H H B")
    TAIL: ClassVar[bool] = True
    index: int
    drops: int
    left: int
    frames: bytes


REQUESTS: dict[int, type[Message]] = {
    kind.TYPE: kind
    for kind in (
        Hello,
        Read,
        Burst,
        Write,
        Stream,
        Leave,
        BlobState,
        BlobRead,
        BlobBegin,
        BlobData,
        BlobCommit,
        BlobErase,
    )
}
ANSWERS: dict[int, type[Reply]] = {
    kind.TYPE: kind
    for kind in (
        HelloReply,
        ReadReply,
        BurstReply,
        WriteReply,
        StreamReply,
        LeaveReply,
        BlobStateReply,
        BlobReadReply,
        BlobBeginReply,
        BlobDataReply,
        BlobCommitReply,
        BlobEraseReply,
        Frames,
    )
}


def answer_of(kind: int, payload: bytes) -> Reply:
    """What a bridge says in a message of type `kind`; a bare Reply where a failed one ends early.

    Raises
    ------
    MessageError : no such message, or a payload that is too short.
    """
    try:
        known = ANSWERS[kind]
    except KeyError:
        raise MessageError(f"a bridge sends no message of type 0x{kind:02x}") from None
    start = Reply.decode(payload)
    if start.status != Status.OK and len(payload) < known.FORMAT.size:
        return start
    return known.decode(payload)
