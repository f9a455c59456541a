"""Examination of a bridge: what it can do, how fast its line is, and its firmware, by golden exchanges."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..clocks import MS
from ..doctor.examine import examine_chip
from ..doctor.finding import Finding, Mark
from ..doctor.measure import LONG_BYTES, median_ms
from ..sources.chip import OpenedChip
from . import BridgeBus
from .bus import ADAPTER_NS
from .frame import Deframer, Frame
from .link import REPLY_NS, STORE_NS, Link
from .messages import MAGIC, REPLY_BIT, BlobErase, BlobState, Feature, Frames, Hello, Read, Reply, Status
from .port import Port

EXCHANGES = Path(__file__).with_name("exchanges.json")
# A reply's payload begins with status and t_us; HELLO_REPLY continues with magic, major, minor and address.
BODY_AT = Reply.FORMAT.size
MAJOR_AT = BODY_AT + len(MAGIC)
ADDRESS_AT = MAJOR_AT + 2
# Silence after which nothing more is on its way.
QUIET_NS = 100 * MS

Exchange = Mapping[str, Any]


def exchanges() -> dict[str, Exchange]:
    """Read the golden exchanges by name, as `python -m tools.make vectors` writes them.

    Of each, `rule` says what it tests, and `needs` the features of a bridge: chip, stream, blob (an empty store).
    Each of its `steps` holds the bytes of the `host` and the reply or replies of the `bridge`.
    """
    golden: dict[str, Exchange] = json.loads(EXCHANGES.read_text(encoding="utf-8"))
    return golden


def expected_replies(step: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the replies to a step's requests, in order."""
    bridge = step["bridge"]
    return bridge if isinstance(bridge, list) else [bridge] * (bridge is not None)


def find_difference(step: Mapping[str, Any], received: Sequence[Frame], exact: bool = True) -> str:
    """Describe the first difference from the golden replies; empty: none.

    Parameters
    ----------
    received : frames from the bridge. exact : True if the chip is the one of the exchanges, False for any chip.
    """
    wanted, got = expected_replies(step), [frame for frame in received if frame.type != Frames.TYPE]
    if len(got) != len(wanted):
        return f"{len(got)} replies to {step['host']}, not {len(wanted)}"
    for frame, reply in zip(got, wanted, strict=True):
        payload = bytes.fromhex(reply["payload"])
        if (frame.type, frame.seq) != (reply["type"], reply["seq"]):
            return f"a reply of type 0x{frame.type:02x} and seq {frame.seq} to {step['host']}"
        if frame.payload[:1] != payload[:1]:
            status = f"status {int.from_bytes(frame.payload[:1], 'big')} ({_status_name(frame.payload)})"
            return f"{status} in the reply to {step['host']}, not {payload[0]} ({_status_name(payload)})"
        if payload[0] == Status.OK and not _matches(frame, payload, exact):
            return f"{frame.payload.hex()} in the reply to {step['host']}, not {payload.hex()}"
    return ""


def run_exchange(port: Port, exchange: Exchange, patience_ns: int) -> str:
    """Run an exchange with the greeted bridge on `port`, and describe the first difference; empty: none.

    Parameters
    ----------
    patience_ns : time allowed for a reply.
    """
    _receive(port, 0, QUIET_NS)
    for step in exchange["steps"]:
        port.write(b"\0" + bytes.fromhex(step["host"]))
        wanted = len(expected_replies(step))
        received = _receive(port, wanted, patience_ns if wanted else QUIET_NS)
        difference = find_difference(step, received, exact=False)
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


REMEDY = "firmware_protocol.md has the rule; `python -m tools.make vectors` writes the exchanges"


def examine_bridge(bus: BridgeBus) -> Iterator[Finding]:
    """Examine the bridge's reply to HELLO and its serial line; the speed of the I2C bus behind it cannot be measured.

    Raises
    ------
    BusError : it does not answer any more.
    """
    hello = bus.link.bridge
    pushes, stores = bool(hello.features & Feature.STREAM), bool(hello.features & Feature.BLOB)
    name = hello.name.rstrip(b"\0").decode("ascii", "replace")
    data: dict[str, Any] = {
        "name": name,
        "version": f"{hello.major}.{hello.minor}",
        "address": hello.address,
        "pushes": pushes,
        "blob_bytes": hello.blob_bytes if stores else 0,
        "window": hello.window,
    }
    keeps = f"stores {hello.blob_bytes} bytes of calibration" if stores else "stores no calibration"
    what = f"{name or 'unnamed'}, protocol {data['version']}, chip at 0x{hello.address:02x}; it {keeps}"
    remedy = "keep to 200 Hz or less, or flash a firmware that pushes samples (mpucal/firmware)"
    yield Finding.check("bridge", pushes, f"{what}, and pushes {'' if pushes else 'no '}samples", remedy, data)
    read_ms = median_ms(bus, LONG_BYTES)
    what = f"a read of {LONG_BYTES} bytes takes {read_ms:.1f} ms there and back"
    remedy = "connect it directly, without a hub or a network"
    data = {f"read_{LONG_BYTES}_bytes_ms": read_ms}
    # a reply may wait for the adapter's latency timer once
    yield Finding.check("serial line", read_ms <= 2.0 * ADAPTER_NS / MS, what, remedy, data)


def examine_conformance(link: Link) -> Iterator[Finding]:
    """Run the exchanges that this bridge has the features for; a stored calibration is not overwritten.

    Raises
    ------
    BusError : it does not answer any more.
    """
    hello = link.bridge
    has = {"chip": bool(hello.address), "stream": bool(hello.features & Feature.STREAM), "blob": False}
    why = {"chip": "no chip answers", "stream": "it pushes no samples", "blob": "it stores no calibration"}
    if hello.features & Feature.OCCUPIED:
        why["blob"] = "its memory holds other data, which is kept"
    elif hello.features & Feature.BLOB:
        # The exchanges about storing would overwrite a stored calibration.
        has["blob"] = link.ask(BlobState())[0][-1].reply.status == Status.NO_BLOB
        why["blob"] = "it stores a calibration, which is kept"
    for name, exchange in exchanges().items():
        lacks = [why[need] for need in exchange["needs"] if not has[need]]
        if lacks:
            yield Finding(name, Mark.UNKNOWN, f"not tried, as {lacks[0]}: {exchange['rule']}")
        else:
            yield _run_exchange(link, name, exchange)


def _run_exchange(link: Link, name: str, exchange: Exchange) -> Finding:
    stores = "blob" in exchange["needs"]
    # An exchange before may have left another address.
    link.greet()
    differs = run_exchange(link.port, exchange, (STORE_NS if stores else REPLY_NS) + link.latency.most_ns)
    link.greet()
    if stores:
        link.ask(BlobErase())
    what = f"{differs}; the rule is: {exchange['rule']}" if differs else exchange["rule"]
    return Finding.check(name, not differs, what, REMEDY, {}, Mark.BAD)


def examine_bridge_and_chip(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """Examine a bridge's firmware, its serial line, and the chip behind it."""
    return examine_chip(source, seconds, examine_bridge)
