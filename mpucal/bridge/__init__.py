"""Chip behind a microcontroller on a serial line: link, examination and memory, by firmware_protocol.md."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from typing import Any

from ..sources.chip import OpenedChip
from ..sources.kind import Request
from .bus import BridgeBus
from .link import Link
from .micropython import MicroPythonPort
from .port import Port, SerialPort
from .store import BlobStore

__all__ = ["BlobStore", "BridgeBus", "open_link", "open_source", "open_store"]


def open_source(request: Request) -> OpenedChip:
    """Open the chip behind the bridge on PORT[:BAUD], or on a URL of pyserial such as socket://host:port.

    Raises
    ------
    UsageError : no port is named.
    BusError : no such port, or no bridge on it. NoAnswer : the bridge finds no chip.
    """
    bus = BridgeBus(_open_port(request.values), request.values.get("address"))
    return OpenedChip(bus, request.plan, words=request.words)


@contextmanager
def open_store(values: Mapping[str, Any]) -> Iterator[BlobStore]:
    """Open the memory of the bridge that the options' values name; see open_link."""
    with open_link(values) as link:
        yield BlobStore(link)


@contextmanager
def open_link(values: Mapping[str, Any]) -> Iterator[Link]:
    """Open and greet the bridge that the options' values name; it need not find a chip.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, or no bridge on it.
    """
    with closing(_open_port(values)) as port:
        link = Link(port)
        link.greet()
        yield link


def _open_port(values: Mapping[str, Any]) -> Port:
    """Open a port; the bridge is started on a board with MicroPython, on the named pins or its own."""
    pins: tuple[int | str, ...] | None = values.get("micropython")
    return SerialPort(values["serial"]) if pins is None else MicroPythonPort(values["serial"], pins)
