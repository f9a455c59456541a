"""A transport that is opened again where what it leads to went away: a flight controller on USB that reboots."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ..errors import BusError, LinkError
from .transport import ReceivedBytes, SteadyClock, Transport
from .url import Kind, Url

# between two looks for what went away
LOOK_NS = 500_000_000


class Board(NamedTuple):
    """How a USB device names itself, whatever the system calls its port."""

    vid: int
    pid: int
    serial_number: str


class ReconnectingTransport:
    """The transport at `url`; while it is away nothing comes, and what is sent is lost.

    A board on USB may come back as another port: it is looked for by the serial number that it had. See Transport.

    Raises
    ------
    LinkError : it cannot be opened at first.
    """

    outward = True

    def __init__(self, url: Url, opener: Callable[[Url], Transport]) -> None:
        self._url, self._opener = url, opener
        self._clock = SteadyClock()
        self._transport: Transport | None = opener(url)
        self._board = _boards().get(_device(url)) if url.kind is Kind.SERIAL else None
        self._next_look_ns = 0
        self.name, self.datagrams = self._transport.name, self._transport.datagrams

    def now_ns(self) -> int:
        """See Transport."""
        return self._clock.now_ns()

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport."""
        if self._transport is None:
            self._look(until_ns)
            return None
        wait_ns = max(until_ns - self.now_ns(), 0)
        try:
            received = self._transport.receive(self._transport.now_ns() + wait_ns)
        except LinkError:
            self._away()
            return None
        # one clock, whichever transport it is by now; and one name, by which the link is locked
        return None if received is None else ReceivedBytes(received.data, self.name, self.now_ns())

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport."""
        if self._transport is not None:
            try:
                self._transport.send(data, address)
            except LinkError:
                self._away()

    def restrict(self, address: str | None) -> None:
        """See Transport: it has one partner."""

    def close(self) -> None:
        """See Transport."""
        if self._transport is not None:
            self._transport.close()

    def _away(self) -> None:
        if self._transport is not None:
            # a port that is held open keeps its name from the device that comes back
            self._transport.close()
        self._transport = None

    def _look(self, until_ns: int) -> None:
        """Open it where it is back; else let time pass."""
        now_ns = self.now_ns()
        if now_ns < self._next_look_ns:
            time.sleep(max(min(until_ns, self._next_look_ns) - now_ns, 0) * 1e-9)
            return
        self._next_look_ns = now_ns + LOOK_NS
        with suppress(BusError):
            self._transport = self._opener(self._found())

    def _found(self) -> Url:
        if self._board is None:
            return self._url
        at = next((device for device, board in _boards().items() if board == self._board), None)
        if at is None:
            raise LinkError(f"{self._url} is gone", "plug it in again")
        return self._url if at == _device(self._url) else replace(self._url, host=at)


def _device(url: Url) -> str:
    """The port itself, where a link such as /dev/serial/by-id leads to it."""
    path = Path(url.host)
    return str(path.resolve()) if path.exists() else url.host


def _boards() -> dict[str, Board]:
    """The boards on USB that have a serial number, by port."""
    from serial.tools.list_ports import comports  # noqa: PLC0415

    return {p.device: Board(p.vid, p.pid, p.serial_number) for p in comports() if p.vid and p.serial_number}
