"""A chip behind a microcontroller on a serial line, as firmware_protocol.md says."""

from __future__ import annotations

from .bus import BridgeBus
from .port import SerialPort

__all__ = ["BridgeBus", "open_bridge"]


def open_bridge(text: str, address: int | None = None) -> BridgeBus:
    """The chip behind the bridge on PORT[:BAUD], or on a URL as pyserial knows them, such as socket://host:port.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, or no bridge on it. NoAnswer : the bridge finds no chip.
    """
    return BridgeBus(SerialPort(text), address)
