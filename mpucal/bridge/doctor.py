"""Examination of a serial bridge: HELLO, the time of a read, and its conformance to firmware_protocol.md."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..doctor.examine import examine_chip
from ..doctor.finding import Finding, Mark
from ..doctor.measure import LONG_BYTES, median_ms
from ..sources.chip import OpenedChip
from . import BridgeBus
from .conformance import Talk, run_talk, talks
from .link import REPLY_NS, STORE_NS, Link
from .messages import BlobErase, BlobState, Feature, Status

# Twice the time of a read with the 16 ms latency timer of an FTDI adapter.
SLOW_MS = 35.0

REMEDY = "firmware_protocol.md has the rule; `python -m tools.make vectors` writes the talks"


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
    yield Finding.check("serial line", read_ms <= SLOW_MS, what, remedy, data)


def examine_conformance(link: Link) -> Iterator[Finding]:
    """Run each talk that this bridge can hold, over an open link; a stored calibration is not overwritten.

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
        # The talks about storing would overwrite a stored calibration.
        has["blob"] = link.ask(BlobState())[0][-1].reply.status == Status.NO_BLOB
        why["blob"] = "it stores a calibration, which is kept"
    for name, talk in talks().items():
        lacks = [why[need] for need in talk["needs"] if not has[need]]
        if lacks:
            yield Finding(name, Mark.UNKNOWN, f"not tried, as {lacks[0]}: {talk['settled']}")
        else:
            yield _run_talk(link, name, talk)


def _run_talk(link: Link, name: str, talk: Talk) -> Finding:
    stores = "blob" in talk["needs"]
    # A talk before may have left another address.
    link.greet()
    differs = run_talk(link.port, talk, (STORE_NS if stores else REPLY_NS) + link.latency.most_ns)
    link.greet()
    if stores:
        link.ask(BlobErase())
    what = f"{differs}; the rule is: {talk['settled']}" if differs else talk["settled"]
    return Finding.check(name, not differs, what, REMEDY, {}, Mark.BAD)


def examine_bridge_and_chip(source: OpenedChip, seconds: float) -> Iterator[Finding]:
    """Examine a bridge's firmware, its serial line, and the chip behind it."""
    return examine_chip(source, seconds, examine_bridge)
