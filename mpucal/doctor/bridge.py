"""Examination of a serial bridge: its HELLO, and the time that a read takes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..chip.access import Bus
from ..sources.bridge import BridgeBus
from ..sources.bridge.messages import Feature
from .bus_speed import LONG_BYTES, median_ms
from .finding import Finding

# Twice the time of a read with the 16 ms latency timer of an FTDI adapter.
SLOW_MS = 35.0


def examine_bridge(bus: Bus) -> Iterator[Finding]:
    """Examine the bridge's reply to HELLO and its serial line; the speed of the I2C bus behind it cannot be measured.

    Raises
    ------
    BusError : it does not answer any more.
    """
    if not isinstance(bus, BridgeBus):
        raise TypeError("only a BridgeBus has a bridge")
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
