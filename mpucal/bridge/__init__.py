"""Chip behind a microcontroller on a serial line: link, examination and memory, by firmware_protocol.md."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from typing import Any

from ..errors import UsageError
from ..sources.chip import OpenedChip
from ..sources.kind import Request
from .bus import BridgeBus
from .link import Link
from .micropython import MicroPythonPort
from .port import Port, SerialPort
from .store import BlobStore

__all__ = ["BlobStore", "BridgeBus", "open_bridge", "open_link", "open_source", "open_store"]


def open_bridge(text: str, address: int | None = None, pins: tuple[int | str, ...] | None = None) -> BridgeBus:
    """Open the chip behind the bridge on PORT[:BAUD], or on a URL of pyserial such as socket://host:port.

    Parameters
    ----------
    pins : SDA and SCL of a board with MicroPython, on which the bridge is started; empty: the board's own pins; None:
        the board has the bridge's firmware.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, or no bridge on it. NoAnswer : the bridge finds no chip.
    """
    return BridgeBus(_open_port(text, pins), address)


def open_source(request: Request) -> OpenedChip:
    """Open the chip behind the bridge on a port; see open_bridge.

    Raises
    ------
    UsageError : the requested rate is more than a serial line can carry.
    """
    config = request.plan.config
    if config.accel_only:
        raise UsageError(
            f"a bridge cannot carry {config.rate_hz:g} samples a second",
            "use --rate 1000 or less, or connect the chip to an I2C bus of this computer",
        )
    bridge = open_bridge(request.value, request.values.get("address"), request.values.get("micropython"))
    return OpenedChip(bridge, request.plan, words=request.words)


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
    with closing(_open_port(values["serial"], values.get("micropython"))) as port:
        link = Link(port)
        link.greet()
        yield link


def _open_port(text: str, pins: tuple[int | str, ...] | None) -> Port:
    return SerialPort(text) if pins is None else MicroPythonPort(text, pins)
