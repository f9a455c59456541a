"""Messages of the serial bridge: payloads converted to values and back.

See firmware_protocol.md, "Messages"; each class is the table of its name there.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import ClassVar, Self, dataclass_transform

MAGIC = b"MPUB"
MAJOR, MINOR = 1, 0
REPLY_BIT = 0x80

MAX_READ = 56
MAX_WRITE = 32
MAX_BURST = 4096
MAX_CHUNK = MAX_WRITE
MAX_LOOK = 73
MAX_BATCH = 32
MIN_WINDOW = 2


class MessageError(ValueError):
    """Payload that does not have its message's form, or value that does not fit its field."""


class Status(IntEnum):
    """Result of a request; see "Status codes"."""

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
    OCCUPIED = 14


class Feature(IntFlag):
    """Features of a bridge besides register access; OCCUPIED: the memory for the blob holds other data."""

    STREAM = 1
    BLOB = 2
    LEAVE = 4
    OCCUPIED = 8


_KINDS: dict[int, type[Message]] = {}


@dataclass_transform(frozen_default=True)
class Message:
    """Base of the messages, which are dataclasses: the fixed fields in FORMAT's order, then the bytes of TAIL, if any.

    A subclass with a `code` is a message of that type: requests are below 0x80, and what a bridge sends is above.
    """

    TYPE: ClassVar[int]
    FORMAT: ClassVar[struct.Struct] = struct.Struct("<")
    TAIL: ClassVar[bool] = False

    def __init_subclass__(cls, code: int | None = None, form: str | None = None, tail: bool = False) -> None:
        if code is not None:
            cls.TYPE = code
            _KINDS[code] = cls
        if form is not None:
            cls.FORMAT = struct.Struct(form)
        cls.TAIL = tail
        dataclass(frozen=True)(cls)

    def payload(self) -> bytes:
        """Encode the payload.

        Raises
        ------
        MessageError : a value does not fit its field.
        """
        values = list(vars(self).values())
        tail = values.pop() if self.TAIL else b""
        try:
            return self.FORMAT.pack(*values) + bytes(tail)
        except struct.error as error:
            raise MessageError(f"a value of {type(self).__name__} does not fit its field ({error})") from error

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload; fields that a newer minor version appended are skipped.

        Raises
        ------
        MessageError : the payload is too short.
        """
        size = cls.FORMAT.size
        if len(payload) < size:
            raise MessageError(f"{len(payload)} bytes are too short for {cls.__name__}, {size} or more")
        tail = (payload[size:],) if cls.TAIL else ()
        return cls(*cls.FORMAT.unpack_from(payload), *tail)


class Hello(Message, code=0x01, form="<4s B B B"):
    """Greeting; with `address` 0 the bridge tries both."""

    magic: bytes = MAGIC
    major: int = MAJOR
    minor: int = MINOR
    address: int = 0


class Read(Message, code=0x02, form="<B B"):
    """Request to read `count` registers from `register` on."""

    register: int
    count: int


class Burst(Message, code=0x03, form="<B H"):
    """Request to read `count` bytes from a register that does not auto-increment."""

    register: int
    count: int


class Write(Message, code=0x04, form="<B", tail=True):
    """Request to write `data` from `register` on."""

    register: int
    data: bytes


class Stream(Message, code=0x05, form="<B B"):
    """Request to push frames of `frame_bytes` from the FIFO, `batch` or more at a time; 0 stops it."""

    frame_bytes: int
    batch: int


class Leave(Message, code=0x06):
    """Request to end a program that was started from a REPL."""


class BlobState(Message, code=0x10):
    """Request for the state of the stored blob."""


class BlobRead(Message, code=0x11, form="<H B"):
    """Request for `count` bytes of the stored blob."""

    offset: int
    count: int


class BlobBegin(Message, code=0x12, form="<H"):
    """Announcement of a blob of `length` bytes."""

    length: int


class BlobData(Message, code=0x13, form="<H", tail=True):
    """Part of the announced blob."""

    offset: int
    data: bytes


class BlobCommit(Message, code=0x14, form="<H I"):
    """End of the announced blob; `crc` is its CRC-32."""

    length: int
    crc: int


class BlobErase(Message, code=0x15):
    """Request to erase the stored blob."""


class Reply(Message, form="<B I"):
    """Beginning of every message of a bridge; a failed request may have no more.

    `t_us`: the bridge's clock, modulo 2**32, when the transfer began or the request was handled.
    """

    status: int
    t_us: int


class HelloReply(Reply, code=Hello.TYPE | REPLY_BIT, form="<B I 4s B B B B B H 16s"):
    """Description of the bridge: version, the chip's address (0: none answers), features and limits."""

    magic: bytes
    major: int
    minor: int
    address: int
    features: int
    window: int
    blob_bytes: int
    name: bytes


class ReadReply(Reply, code=Read.TYPE | REPLY_BIT, tail=True):
    """Bytes that were read."""

    data: bytes


class BurstReply(Reply, code=Burst.TYPE | REPLY_BIT, form="<B I H", tail=True):
    """Part of a burst, from `offset` on."""

    offset: int
    data: bytes


class WriteReply(Reply, code=Write.TYPE | REPLY_BIT):
    """Confirmation of a write."""


class StreamReply(Reply, code=Stream.TYPE | REPLY_BIT):
    """Confirmation that the stream began or stopped."""


class LeaveReply(Reply, code=Leave.TYPE | REPLY_BIT):
    """Confirmation that the program ends."""


class BlobStateReply(Reply, code=BlobState.TYPE | REPLY_BIT, form="<B I I H I"):
    """State of the stored blob, which the bridge has just checked."""

    generation: int
    length: int
    crc: int


class BlobReadReply(Reply, code=BlobRead.TYPE | REPLY_BIT, tail=True):
    """Bytes of the stored blob."""

    data: bytes


class BlobBeginReply(Reply, code=BlobBegin.TYPE | REPLY_BIT):
    """Confirmation of an announcement."""


class BlobDataReply(Reply, code=BlobData.TYPE | REPLY_BIT):
    """Confirmation of a part, which is in the slot that is not in use."""


class BlobCommitReply(Reply, code=BlobCommit.TYPE | REPLY_BIT, form="<B I I"):
    """Confirmation that the new blob is valid and in use."""

    generation: int


class BlobEraseReply(Reply, code=BlobErase.TYPE | REPLY_BIT):
    """Confirmation that no blob is stored."""


class Frames(Reply, code=0xC0, form="<B I H H B", tail=True):
    """Content of the FIFO; `left` more frames that were counted at `t_us` follow. `status`: why the stream halted."""

    index: int
    drops: int
    left: int
    frames: bytes


REQUESTS = {code: kind for code, kind in _KINDS.items() if not issubclass(kind, Reply)}
ANSWERS = {code: kind for code, kind in _KINDS.items() if issubclass(kind, Reply)}


def answer_of(code: int, payload: bytes) -> Reply:
    """Decode a message of a bridge; a failed reply that ends early becomes a bare Reply.

    Raises
    ------
    MessageError : an unknown message, or a payload that is too short.
    """
    known = ANSWERS.get(code)
    if known is None:
        raise MessageError(f"a bridge sends no message of type 0x{code:02x}")
    start = Reply.decode(payload)
    if start.status != Status.OK and len(payload) < known.FORMAT.size:
        return start
    return known.decode(payload)
