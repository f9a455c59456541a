"""Messages of a capture: register accesses on BUS, many to a message, and session events on SESSION.

A vehicle's capture has PACKETS in place of BUS: a message is one packet of MAVLink as it was received or sent.

A message of accesses has columns with one entry per access, in Protocol Buffers' encoding. The file holds the schema:

    kind         a sum of WRITE, HEARD and FRAMED
    register     address; from 256 on, a file of a kernel driver: files[register - 256]
    count        bytes requested or given
    moved        bytes transferred
    step_ns      the bus's clock minus that of the access before; the first is absolute
    heard_ns     only of HEARD: the host's clock minus the bus's, minus that of the one before; the first is absolute
    data         the bytes transferred, except those of FRAMED
    frame_words  number of words of a frame
    words        the frames of FRAMED: int16, each minus the same word of the frame before, modulo 2^16
    failures     of failed accesses: index (from 0) and error
    files        names, such as iio:device0/in_accel_scale

Events are JSON.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..chip.access import Failure, SessionEvent
from ..chip.accesses import Accesses
from ..mavlink.dialect import is_packet
from ..mavlink.tlog import RawPacket
from ..strict_json import parse_own_json
from . import protobuf

BUS, PACKETS, SESSION = "/bus", "/mavlink", "/session"
WRITE, HEARD, FRAMED = 1, 2, 4

# name, type, repeated; numbered from 1
_FAILURE = (("access", "uint32", False), *((name, "string", False) for name in Failure._fields))
_ACCESSES = (
    ("kind", "uint32", True),
    ("register", "uint32", True),
    ("count", "uint32", True),
    ("moved", "uint32", True),
    ("step_ns", "sint64", True),
    ("heard_ns", "sint64", True),
    ("data", "bytes", False),
    ("frame_words", "uint32", False),
    ("words", "sint32", True),
    ("failures", "Failure", True),
    ("files", "string", True),
)
_NAMES = dict(enumerate((name for name, *_ in _ACCESSES), 1))
_NUMBERS = {name: number for number, name in _NAMES.items()}
_EVENT = {
    "title": "mpucal.SessionEvent",
    "description": "A key press, an option, the end; the message's time is the bus's clock.",
    "type": "object",
    "properties": {"name": {"type": "string"}, "data": {"type": "object"}},
}


def accesses_schema() -> bytes:
    """Return the schema of the messages on BUS, a FileDescriptorSet."""
    return protobuf.schema("mpucal", {"Accesses": _ACCESSES, "Failure": _FAILURE})


def event_schema() -> bytes:
    """Return the schema of the messages on SESSION, a JSON Schema."""
    return json.dumps(_EVENT).encode()


def encode_accesses(a: Accesses) -> bytes:
    """Encode one or more register accesses."""
    ahead = (a.host_ns - a.t_ns)[a.has_host_ns]
    columns: dict[str, bytes | int] = {
        "kind": protobuf.pack_varints(WRITE * a.write + HEARD * a.has_host_ns + FRAMED * a.framed),
        "register": protobuf.pack_varints(a.register),
        "count": protobuf.pack_varints(a.count),
        "moved": protobuf.pack_varints(a.moved),
        "step_ns": protobuf.pack_varints(protobuf.steps(a.t_ns)),
        "heard_ns": protobuf.pack_varints(protobuf.steps(ahead)),
        "data": a.data.tobytes(),
        "frame_words": a.frames.shape[1],
        "words": protobuf.pack_varints(protobuf.steps(a.frames)),
    }
    message = b"".join(protobuf.field(number, columns[name]) for number, name in _NAMES.items() if columns.get(name))
    for number, failure in a.failures.items():
        words = enumerate((each.encode() for each in failure), 2)
        content = protobuf.field(1, number) + b"".join(protobuf.field(i, word) for i, word in words)
        message += protobuf.field(_NUMBERS["failures"], content)
    return message + b"".join(protobuf.field(_NUMBERS["files"], name.encode()) for name in a.files)


def decode_accesses(message: bytes) -> Accesses:
    """Decode the accesses of a message.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError : it is not a message on BUS.
    """
    columns: dict[str, Any] = {"data": b"", "frame_words": 1}
    failures: dict[int, Failure] = {}
    files: list[str] = []
    for number, value in protobuf.fields(message):
        if number == _NUMBERS["failures"]:
            which, failure = _failure(value)
            failures[which] = failure
        elif number == _NUMBERS["files"] and isinstance(value, bytes):
            files.append(value.decode())
        elif number in _NAMES:
            columns[_NAMES[number]] = value
    kind, register, count, moved, steps, heard = (
        protobuf.unpacked(columns.get(name, b""))
        for name in ("kind", "register", "count", "moved", "step_ns", "heard_ns")
    )
    if not len(kind):
        raise ValueError("no access")
    t_ns, is_heard = np.cumsum(protobuf.unzigzag(steps)), (kind & np.uint64(HEARD)) > 0
    if len(t_ns) != len(kind) or len(heard) != is_heard.sum():
        raise ValueError("numbers of times and accesses differ")
    host_ns = np.zeros(len(t_ns), np.int64)
    host_ns[is_heard] = t_ns[is_heard] + np.cumsum(protobuf.unzigzag(heard))
    accesses = Accesses(
        (kind & np.uint64(WRITE)) > 0,
        is_heard,
        (kind & np.uint64(FRAMED)) > 0,
        register.view(np.int64),
        count.view(np.int64),
        moved.view(np.int64),
        t_ns,
        host_ns,
        np.frombuffer(columns["data"], np.uint8),
        protobuf.frames(columns.get("words", b""), columns["frame_words"]),
        failures,
        tuple(files),
    )
    accesses.check()
    return accesses


def _failure(message: bytes | int) -> tuple[int, Failure]:
    values = dict(protobuf.fields(message)) if isinstance(message, bytes) else {}
    names = (values.get(i, b"") for i in range(2, 2 + len(Failure._fields)))
    return int(values.get(1, 0)), Failure(*(name.decode() for name in names if isinstance(name, bytes)))


def encode_event(name: str, data: Mapping[str, Any]) -> bytes:
    """Encode a session event; `data` of JSON types."""
    return json.dumps({"name": name, "data": dict(data)}, separators=(",", ":")).encode()


def decode_message(topic: str, t_ns: int, message: bytes) -> Accesses | RawPacket | SessionEvent | None:
    """Decode a message; None for the topic of a newer mpucal.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError : it is not a message of that topic.
    """
    if topic == BUS:
        return decode_accesses(message)
    if topic == PACKETS:
        if not is_packet(message):
            raise ValueError(f"{len(message)} bytes are no packet")
        return RawPacket(t_ns, message)
    if topic == SESSION:
        content = parse_own_json(message)
        return SessionEvent(content["name"], t_ns, content["data"])
    return None
