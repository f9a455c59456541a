"""A serial bridge: what it says of itself, and how long a register takes through it."""

from __future__ import annotations

from collections.abc import Iterator

from ..chip.access import Bus
from ..sources.bridge import BridgeBus
from ..sources.bridge.messages import Feature
from .finding import Finding, Mark
from .speed import LONG_BYTES, median_ms

# twice what the 16 ms latency timer of an FTDI adapter makes of it
SLOW_MS = 35.0


def examine_bridge(bus: Bus) -> Iterator[Finding]:
    """What the reply to HELLO holds, and the time of a read: the bus's own speed does not show through the line.

    Raises
    ------
    BusError : it does not answer any more.
    """
    if not isinstance(bus, BridgeBus):
        raise TypeError("only a BridgeBus has a bridge")
    hello = bus.link.bridge
    pushes, stores = bool(hello.features & Feature.STREAM), bool(hello.features & Feature.BLOB)
    name = hello.name.rstrip(b"\0").decode("ascii", "replace")
    data = {
        "name": name,
        "version": f"{hello.major}.{hello.minor}",
        "address": hello.address,
        "pushes": pushes,
        "blob_bytes": hello.blob_bytes if stores else 0,
        "window": hello.window,
    }
    keeps = f"stores {hello.blob_bytes} bytes of calibration" if stores else "stores no calibration"
    what = f"{name or 'unnamed'}, protocol {data['version']}, chip at 0x{hello.address:02x}; it {keeps}"
    if pushes:
        yield Finding("bridge", Mark.OK, f"{what}, and pushes samples", "", data)
    else:
        remedy = "keep to 200 Hz or less, or put a firmware on it that pushes samples (mpucal/firmware)"
        yield Finding("bridge", Mark.NOTE, f"{what}, and pushes no samples", remedy, data)
    yield _line(median_ms(bus, LONG_BYTES))


def _line(took_ms: float) -> Finding:
    slow = took_ms > SLOW_MS
    return Finding(
        "serial line",
        Mark.NOTE if slow else Mark.OK,
        f"a read of {LONG_BYTES} bytes takes {took_ms:.1f} ms there and back",
        "connect it directly, without a hub or a network" if slow else "",
        {f"read_{LONG_BYTES}_bytes_ms": took_ms},
    )
