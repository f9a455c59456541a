"""A chip behind a microcontroller on a serial line, as firmware_protocol.md says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from typing import Any

from .bus import BridgeBus
from .link import Link
from .messages import Frames
from .micropython import MicroPythonPort
from .port import Port, SerialPort
from .store import BlobStore

__all__ = ["BlobStore", "BridgeBus", "open_bridge", "open_link", "open_store"]


def open_bridge(text: str, address: int | None = None, pins: tuple[int | str, ...] | None = None) -> BridgeBus:
    """The chip behind the bridge on PORT[:BAUD], or on a URL as pyserial knows them, such as socket://host:port.

    Parameters
    ----------
    pins : SDA and SCL of a board that runs MicroPython, which is given the bridge to run; empty: its own; None: the
        board has the bridge's firmware.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, or no bridge on it. NoAnswer : the bridge finds no chip.
    """
    return BridgeBus(_port(text, pins), address)


@contextmanager
def open_store(values: Mapping[str, Any]) -> Iterator[BlobStore]:
    """The memory of the bridge that the options' values name; see open_link."""
    with open_link(values) as link:
        yield BlobStore(link)


@contextmanager
def open_link(values: Mapping[str, Any]) -> Iterator[Link]:
    """The bridge that the options' values name, greeted, whether or not it finds a chip.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, or no bridge on it.
    """
    with closing(_port(values["serial"], values.get("micropython"))) as port:
        link = Link(port, _unheard)
        link.greet()
        yield link


def _port(text: str, pins: tuple[int | str, ...] | None) -> Port:
    return SerialPort(text) if pins is None else MicroPythonPort(text, pins)


def _unheard(seq: int, frames: Frames, t_ns: int, host_ns: int) -> None:
    """Nobody listens to what is pushed."""
