"""Transports over UDP, TCP and serial lines; a connection or a device that goes away is opened again."""

from __future__ import annotations

import errno
import os
import select
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import BusError, LinkError, NoAnswer
from .transport import OnePartner, ReceivedBytes, SteadyClock, Transport
from .url import Kind, Url

RETRY_NS = 500_000_000


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


def _usb_boards() -> dict[str, tuple[int, int, str]]:
    """Return vendor, product and serial number of the boards on USB, by port, which may get another name."""
    from serial.tools.list_ports import comports  # noqa: PLC0415

    return {p.device: (p.vid, p.pid, p.serial_number) for p in comports() if p.vid and p.serial_number}


CHUNK = 65536
CONNECT_S = 5.0
# Three IMUs may pile this up in a second in which a fit keeps the processor busy.
RECEIVE_BUFFER = 4 << 20


class Udp(SteadyClock):
    """UDP socket, which listens to every sender or speaks to one partner.

    Raises
    ------
    LinkError : the port is taken, or the host is unknown.
    """

    datagrams = True

    def __init__(self, url: Url) -> None:
        super().__init__()
        self.name = str(url)
        self.outward = url.kind is Kind.UDPOUT
        self._url = url
        self._open()

    def _open(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            self._partner = (socket.gethostbyname(self._url.host), self._url.port)
            self._socket.bind(("", 0) if self.outward else self._partner)
        except OSError as error:
            self._socket.close()
            raise _cannot_open(self._url, error) from error

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport. A partner that refuses our datagrams is not there yet."""
        if not _readable(self._socket, until_ns - self.now_ns()):
            return None
        try:
            data, (host, port) = self._socket.recvfrom(CHUNK)
        except (ConnectionError, BlockingIOError):
            return None
        return ReceivedBytes(data, f"{host}:{port}", self.now_ns())

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport. A datagram that cannot be sent is lost, as any datagram may be."""
        with suppress(OSError):
            self._socket.sendto(data, _host_port(address) if address else self._partner)

    def restrict(self, address: str | None) -> None:
        """See Transport. The kernel drops other senders' datagrams before they fill a connected socket's buffer."""
        if address is None:
            self._socket.close()
            self._open()
            return
        with suppress(OSError):
            self._socket.connect(_host_port(address))
            self._partner = _host_port(address)

    def close(self) -> None:
        """See Transport."""
        self._socket.close()


class Tcp(OnePartner):
    """TCP connection to a vehicle or a router.

    Raises
    ------
    NoAnswer : nobody listens there. LinkError : the host is unknown.
    """

    datagrams, outward = False, True

    def __init__(self, url: Url) -> None:
        super().__init__()
        self.name = str(url)
        try:
            self._socket = socket.create_connection((url.host, url.port), CONNECT_S)
        except (ConnectionRefusedError, TimeoutError) as error:
            raise NoAnswer(
                f"nothing answers at {url}", "start the vehicle or its router, and check host and port"
            ) from error
        except OSError as error:
            raise _cannot_open(url, error) from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport."""
        if not _readable(self._socket, until_ns - self.now_ns()):
            return None
        try:
            data = self._socket.recv(CHUNK)
        except OSError as error:
            raise _broken(self.name, error) from error
        if not data:
            raise LinkError(f"{self.name} closed the connection", "restart it, then the session")
        return ReceivedBytes(data, self.name, self.now_ns())

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport."""
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise _broken(self.name, error) from error

    def close(self) -> None:
        """See Transport."""
        self._socket.close()


class Serial(OnePartner):
    """Serial line: an autopilot's USB port or a telemetry radio.

    Raises
    ------
    LinkError : there is no such device, or no permission to open it.
    """

    datagrams, outward = False, True

    def __init__(self, url: Url) -> None:
        import serial  # noqa: PLC0415

        super().__init__()
        self.name = str(url)
        try:
            self._port = serial.Serial(url.host, url.port, timeout=0, write_timeout=1.0, exclusive=True)
        except (OSError, ValueError) as error:
            raise _cannot_open(url, error) from error

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport."""
        try:
            data = self._read(until_ns - self.now_ns())
        except OSError as error:
            raise _broken(self.name, error) from error
        return ReceivedBytes(data, self.name, self.now_ns()) if data else None

    def _read(self, wait_ns: int) -> bytes:
        if not hasattr(self._port, "fileno"):  # Windows has no file descriptor to wait for.
            self._port.timeout = max(wait_ns, 0) * 1e-9
            return bytes(self._port.read(max(1, self._port.in_waiting)))
        return bytes(self._port.read(CHUNK)) if _readable(self._port, wait_ns) else b""

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport."""
        try:
            self._port.write(data)
        except OSError as error:
            raise _broken(self.name, error) from error

    def close(self) -> None:
        """See Transport."""
        self._port.close()


def open_transport(url: Url) -> Transport:
    """Open the transport that a URL names; a connection or a device that goes away is opened again.

    Raises
    ------
    LinkError : it cannot be opened.
    """
    if url.kind is Kind.TCP:
        return ReconnectingTransport(url, Tcp)
    return ReconnectingTransport(url, Serial) if url.kind is Kind.SERIAL else Udp(url)


def _host_port(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    return host, int(port)


def _readable(channel: Any, wait_ns: int) -> bool:
    return bool(select.select([channel], [], [], max(wait_ns, 0) * 1e-9)[0])


def _cannot_open(url: Url, error: Exception) -> LinkError:
    remedy = "check that it is plugged in, that no other program uses it, and that you may open it"
    if url.kind is not Kind.SERIAL:
        remedy = "check host and port, and that no other ground station listens there"
    return LinkError(f"{url} cannot be opened ({_cause(error)})", remedy)


def _broken(name: str, error: Exception) -> LinkError:
    return LinkError(f"the link over {name} broke ({_cause(error)})", "check cable and power, then start again")


def _cause(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number in (errno.EAGAIN, errno.EBUSY):
        return "another program uses it"
    return str(error) if number is None or number < 0 else os.strerror(number)
