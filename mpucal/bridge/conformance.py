"""Conformance test of a bridge: golden talks of firmware_protocol.md, exchange by exchange."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .frame import Deframer, Frame
from .link import MS
from .messages import MAGIC, REPLY_BIT, Frames, Hello, Read, Status
from .port import Port

TALKS = Path(__file__).with_name("talks.json")
# A reply's payload begins with status and t_us; HELLO_REPLY continues with magic, major, minor and address.
BODY_AT, MAJOR_AT, ADDRESS_AT = 5, 9, 11
# Silence after which nothing more is on its way.
QUIET_NS = 100 * MS

Talk = Mapping[str, Any]


def talks() -> dict[str, Talk]:
    """Read the golden talks by name, as `python -m tools.make vectors` writes them.

    Each names the rule that is `settled` and what it `needs` of a bridge ("chip", "stream"; "blob": an empty store).
    Its exchanges are in `talk`: bytes of the `host`, and the reply or replies of the `bridge`.
    """
    golden: dict[str, Talk] = json.loads(TALKS.read_text(encoding="utf-8"))
    return golden


def expected_replies(exchange: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the replies to an exchange's requests, in order."""
    bridge = exchange["bridge"]
    return bridge if isinstance(bridge, list) else [bridge] * (bridge is not None)


def find_difference(exchange: Mapping[str, Any], received: Sequence[Frame], exact: bool = True) -> str:
    """Describe the first difference from the golden replies; empty: none.

    Parameters
    ----------
    received : frames from the bridge. exact : True if the chip is the one of the talks, False for any chip.
    """
    wanted, got = expected_replies(exchange), [frame for frame in received if frame.type != Frames.TYPE]
    if len(got) != len(wanted):
        return f"{len(got)} replies to {exchange['host']}, not {len(wanted)}"
    for frame, reply in zip(got, wanted, strict=True):
        payload = bytes.fromhex(reply["payload"])
        if (frame.type, frame.seq) != (reply["type"], reply["seq"]):
            return f"a reply of type 0x{frame.type:02x} and seq {frame.seq} to {exchange['host']}"
        if frame.payload[:1] != payload[:1]:
            status = f"status {int.from_bytes(frame.payload[:1], 'big')} ({_status_name(frame.payload)})"
            return f"{status} in the reply to {exchange['host']}, not {payload[0]} ({_status_name(payload)})"
        if payload[0] == Status.OK and not _matches(frame, payload, exact):
            return f"{frame.payload.hex()} in the reply to {exchange['host']}, not {payload.hex()}"
    return ""


def run_talk(port: Port, talk: Talk, patience_ns: int) -> str:
    """Run a talk with the greeted bridge on `port`, and describe the first difference; empty: none.

    Parameters
    ----------
    patience_ns : time allowed for a reply.
    """
    _receive(port, 0, QUIET_NS)
    for exchange in talk["talk"]:
        port.write(b"\0" + bytes.fromhex(exchange["host"]))
        wanted = len(expected_replies(exchange))
        received = _receive(port, wanted, patience_ns if wanted else QUIET_NS)
        difference = find_difference(exchange, received, exact=False)
        if difference:
            return difference
    return ""


def _receive(port: Port, count: int, within_ns: int) -> list[Frame]:
    """Receive frames until there are `count` replies, or until the time is over; 0: for all of it."""
    deframer, received, until_ns = Deframer(), list[Frame](), port.now_ns() + within_ns
    while not count or sum(frame.type != Frames.TYPE for frame in received) < count:
        chunk = port.read(until_ns)
        if chunk is None or chunk.t_ns > until_ns:
            break
        received += deframer.feed(chunk.data)
    return received


def _matches(frame: Frame, payload: bytes, exact: bool) -> bool:
    """Return True if a reply has the golden fields; more may be appended."""
    got = frame.payload
    if frame.type == Hello.TYPE | REPLY_BIT:
        named = got[BODY_AT:].startswith(MAGIC) and got[MAJOR_AT : MAJOR_AT + 1] == payload[MAJOR_AT : MAJOR_AT + 1]
        return named and (len(got) > ADDRESS_AT and bool(got[ADDRESS_AT]) == bool(payload[ADDRESS_AT]))
    if frame.type == Read.TYPE | REPLY_BIT and not exact:
        return len(got) == len(payload)
    return got[BODY_AT:].startswith(payload[BODY_AT:])


def _status_name(payload: bytes) -> str:
    try:
        return Status(payload[0]).name
    except (ValueError, IndexError):
        return "unknown"
