"""A transport that is opened again after its other end went away, as a flight controller on USB does that reboots."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ..errors import BusError, LinkError
from .transport import OnePartner, ReceivedBytes, Transport
from .url import Kind, Url

RETRY_NS = 500_000_000


class UsbBoard(NamedTuple):
    """The identity of a USB device, which stays when the system calls its port by another name."""

    vid: int
    pid: int
    serial_number: str


class ReconnectingTransport(OnePartner):
    """Transport at `url`; while the other end is away nothing is received, and what is sent is lost.

    A board on USB may come back as another port: it is looked for by its serial number.

    Raises
    ------
    LinkError : it cannot be opened the first time.
    """

    outward = True

    def __init__(self, url: Url, opener: Callable[[Url], Transport]) -> None:
        super().__init__()
        self._url, self._opener = url, opener
        self._transport: Transport | None = opener(url)
        self._board = _usb_boards().get(_device(url)) if url.kind is Kind.SERIAL else None
        self._next_try_ns = 0
        self.name, self.datagrams = self._transport.name, self._transport.datagrams

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport."""
        if self._transport is None:
            self._reopen(until_ns)
            return None
        wait_ns = max(until_ns - self.now_ns(), 0)
        try:
            received = self._transport.receive(self._transport.now_ns() + wait_ns)
        except LinkError:
            self.close()
            return None
        # The link is locked to one address, and its times must not jump: both stay those of the first transport.
        return None if received is None else ReceivedBytes(received.data, self.name, self.now_ns())

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport."""
        if self._transport is not None:
            try:
                self._transport.send(data, address)
            except LinkError:
                self.close()

    def close(self) -> None:
        """See Transport."""
        if self._transport is not None:
            # A board that comes back would get another name while its old port is open.
            self._transport.close()
        self._transport = None

    def _reopen(self, until_ns: int) -> None:
        """Try to open it again, at most every RETRY_NS; sleep otherwise."""
        now_ns = self.now_ns()
        if now_ns < self._next_try_ns:
            time.sleep(max(min(until_ns, self._next_try_ns) - now_ns, 0) * 1e-9)
            return
        self._next_try_ns = now_ns + RETRY_NS
        with suppress(BusError):
            self._transport = self._opener(self._current_url())

    def _current_url(self) -> Url:
        if self._board is None:
            return self._url
        at = next((device for device, board in _usb_boards().items() if board == self._board), None)
        if at is None:
            raise LinkError(f"{self._url} is gone", "plug it in again")
        return self._url if at == _device(self._url) else replace(self._url, host=at)


def _device(url: Url) -> str:
    """Return the port's own path, to which a link such as /dev/serial/by-id leads."""
    path = Path(url.host)
    return str(path.resolve()) if path.exists() else url.host


def _usb_boards() -> dict[str, UsbBoard]:
    """Return the boards on USB that have a serial number, by port."""
    from serial.tools.list_ports import comports  # noqa: PLC0415

    return {p.device: UsbBoard(p.vid, p.pid, p.serial_number) for p in comports() if p.vid and p.serial_number}
