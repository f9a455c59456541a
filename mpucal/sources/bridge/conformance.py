"""Whether a bridge answers as firmware_protocol.md settles it: golden talks, exchange by exchange."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .frame import Deframer, Frame
from .messages import MAGIC, REPLY_BIT, Frames, Hello, Read, Status
from .port import Port

MS = 1_000_000
TALKS = Path(__file__).with_name("talks.json")
# of a reply's payload: status, t_us; then of HELLO_REPLY magic, major, minor and address
BODY_AT, MAJOR_AT, ADDRESS_AT = 5, 9, 11
# after which nothing comes any more that was on its way
QUIET_NS = 100 * MS

Talk = Mapping[str, Any]


def talks() -> dict[str, Talk]:
    """The golden talks by name, as `python -m tools.make vectors` writes them.

    Each says what is `settled`, what it `needs` of a bridge ("chip", "stream"; "blob": to store, where none is stored),
    and has its exchanges in `talk`: bytes of the `host`, and the reply or replies of the `bridge`.
    """
    held: dict[str, Talk] = json.loads(TALKS.read_text(encoding="utf-8"))
    return held


def due(exchange: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The replies to an exchange's requests, in order."""
    bridge = exchange["bridge"]
    return bridge if isinstance(bridge, list) else [bridge] * (bridge is not None)


def difference(exchange: Mapping[str, Any], said: Sequence[Frame], exact: bool = True) -> str:
    """What is not as it was settled, in words; empty: nothing.

    Parameters
    ----------
    said : the frames that came. exact : whether the chip is the one of the talks, or any.
    """
    wanted, got = due(exchange), [frame for frame in said if frame.type != Frames.TYPE]
    if len(got) != len(wanted):
        return f"{len(got)} replies to {exchange['host']}, not {len(wanted)}"
    for frame, reply in zip(got, wanted, strict=True):
        payload = bytes.fromhex(reply["payload"])
        if (frame.type, frame.seq) != (reply["type"], reply["seq"]):
            return f"a reply of type 0x{frame.type:02x} and seq {frame.seq} to {exchange['host']}"
        if frame.payload[:1] != payload[:1]:
            of = f"status {int.from_bytes(frame.payload[:1], 'big')} ({_name(frame.payload)})"
            return f"{of} in the reply to {exchange['host']}, not {payload[0]} ({_name(payload)})"
        if payload[0] == Status.OK and not _same(frame, payload, exact):
            return f"{frame.payload.hex()} in the reply to {exchange['host']}, not {payload.hex()}"
    return ""


def converse(port: Port, talk: Talk, patience_ns: int) -> str:
    """What the bridge on `port`, which was greeted, answers otherwise than was settled; empty: nothing.

    Parameters
    ----------
    patience_ns : how long a reply may take.
    """
    _heard(port, Deframer(), [], None, port.now_ns() + QUIET_NS)
    for exchange in talk["talk"]:
        deframer, said = Deframer(), list[Frame]()
        port.write(b"\0" + bytes.fromhex(exchange["host"]))
        wanted = len(due(exchange))
        _heard(port, deframer, said, wanted or None, port.now_ns() + (patience_ns if wanted else QUIET_NS))
        differs = difference(exchange, said, exact=False)
        if differs:
            return differs
    return ""


def _heard(port: Port, deframer: Deframer, said: list[Frame], count: int | None, until_ns: int) -> None:
    """Take what comes until there are so many replies, or until the host's clock shows `until_ns`."""
    while count is None or sum(frame.type != Frames.TYPE for frame in said) < count:
        chunk = port.read(until_ns)
        if chunk is None or chunk.t_ns > until_ns:
            return
        said += deframer.feed(chunk.data)


def _same(frame: Frame, payload: bytes, exact: bool) -> bool:
    """Whether the fields of a reply are as they are to be; fields may be appended."""
    got = frame.payload
    if frame.type == Hello.TYPE | REPLY_BIT:
        named = got[BODY_AT:].startswith(MAGIC) and got[MAJOR_AT : MAJOR_AT + 1] == payload[MAJOR_AT : MAJOR_AT + 1]
        return named and (len(got) > ADDRESS_AT and bool(got[ADDRESS_AT]) == bool(payload[ADDRESS_AT]))
    if frame.type == Read.TYPE | REPLY_BIT and not exact:
        return len(got) == len(payload)
    return got[BODY_AT:].startswith(payload[BODY_AT:])


def _name(payload: bytes) -> str:
    try:
        return Status(payload[0]).name
    except (ValueError, IndexError):
        return "unknown"
