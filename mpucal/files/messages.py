"""The messages of a capture, JSON on two topics: register accesses on BUS, session events on SESSION."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ..chip.access import Failure, Transaction
from ..chip.records import Record, SessionEvent

BUS, SESSION = "/bus", "/session"

_BUS = {
    "title": "mpucal.Transaction",
    "description": "A register access; the message's time is the bus's clock.",
    "type": "object",
    "properties": {
        "op": {"enum": ["read", "write"]},
        "register": {
            "type": ["integer", "string"],
            "minimum": 0,
            "maximum": 255,
            "description": "of a chip; or the file of a driver of the kernel, such as iio:device0/in_accel_scale",
        },
        "count": {"type": "integer", "description": "bytes asked for or given"},
        "data": {"type": "string", "description": "bytes moved, hexadecimal"},
        "host_ns": {
            "type": "integer",
            "description": "the host's clock when it heard of that, where the bus's is another",
        },
        "error": {
            "type": "object",
            "description": "how the transfer failed",
            "properties": {key: {"type": "string"} for key in Failure._fields},
        },
    },
}
_SESSION = {
    "title": "mpucal.SessionEvent",
    "description": "A key press, an option, the end; the message's time is the bus's clock.",
    "type": "object",
    "properties": {"name": {"type": "string"}, "data": {"type": "object"}},
}
# topic -> JSON schema of its messages
SCHEMAS: Mapping[str, Mapping[str, Any]] = {BUS: _BUS, SESSION: _SESSION}


def transaction_message(transaction: Transaction) -> bytes:
    """A register access, without its time, which is the message's."""
    content: dict[str, Any] = {
        "op": transaction.op,
        "register": transaction.register,
        "count": transaction.count,
        "data": transaction.data.hex(),
    }
    if transaction.host_ns is not None:
        content["host_ns"] = transaction.host_ns
    if transaction.error is not None:
        content["error"] = transaction.error._asdict()
    return _compact(content)


def event_message(name: str, data: Mapping[str, Any]) -> bytes:
    """A session event; `data` of JSON's own types."""
    return _compact({"name": name, "data": dict(data)})


def record_of(topic: str, t_ns: int, message: bytes) -> Record | None:
    """The record of a message; None for a topic that a newer mpucal added.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError : no message of that topic.
    """
    if topic not in SCHEMAS:
        return None
    content = json.loads(message)
    if topic == SESSION:
        return SessionEvent(content["name"], t_ns, content["data"])
    error = content.get("error")
    return Transaction(
        content["op"],
        content["register"],
        content["count"],
        bytes.fromhex(content["data"]),
        t_ns,
        None if error is None else Failure(**error),
        content.get("host_ns"),
    )


def _compact(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode()
