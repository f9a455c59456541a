"""A chip behind a microcontroller on a serial line, as firmware_protocol.md says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager

from .bus import BridgeBus
from .link import Link
from .messages import Frames
from .port import SerialPort
from .store import Store

__all__ = ["BridgeBus", "Store", "open_bridge", "open_store"]


def open_bridge(text: str, address: int | None = None) -> BridgeBus:
    """The chip behind the bridge on PORT[:BAUD], or on a URL as pyserial knows them, such as socket://host:port.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, or no bridge on it. NoAnswer : the bridge finds no chip.
    """
    return BridgeBus(SerialPort(text), address)


@contextmanager
def open_store(text: str) -> Iterator[Store]:
    """The memory of the bridge on the same, whether or not it finds a chip.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, or no bridge on it.
    """
    with closing(SerialPort(text)) as port:
        link = Link(port, _unheard)
        link.greet()
        yield Store(link)


def _unheard(seq: int, frames: Frames, t_ns: int, host_ns: int) -> None:
    """Nobody listens to what is pushed."""
