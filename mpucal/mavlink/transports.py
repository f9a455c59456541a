"""Transports over UDP, TCP and serial lines; a transport moves a link's bytes, and has its clock.

The replay of a capture and the simulated vehicle are transports, too. A connection or device that goes away is opened
again.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ..clocks import US, S
from ..errors import BusError, LinkError, NoAnswer
from .url import Kind, Url

# A receive that ends so much after its deadline was interrupted, by SIGSTOP or a suspended computer.
PAUSE_NS = 3 * S
CHUNK = 65536
RETRY_NS = 500_000_000
CONNECT_S = 5.0
# The stream of three IMUs in a second in which a fit keeps the processor busy.
RECEIVE_BUFFER = 4 << 20


class ReceivedBytes(NamedTuple):
    """A datagram or a piece of a stream, its sender's address, and when it arrived [ns since 1970, whole us]."""

    data: bytes
    address: str
    t_ns: int


class Transport(Protocol):
    """Carrier of a link's bytes.

    Attributes
    ----------
    name : the other end, as messages call it.
    datagrams : bytes come in datagrams of whole packets; otherwise as a stream.
    outward : it leads to one partner that the user named, to whom we may send before anything is received.
    """

    name: str
    datagrams: bool
    outward: bool

    def now_ns(self) -> int:
        """Return the time in ns since 1970, in whole us as in a .tlog; it never decreases."""
        ...

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """Return the next bytes, or None if none come until `until_ns`. Raises EndOfCapture or LinkError."""
        ...

    def send(self, data: bytes, address: str | None) -> None:
        """Send to an address as `receive` gave it; None is the partner of an outward transport. Raises LinkError."""
        ...

    def restrict(self, address: str | None) -> None:
        """Accept bytes from that address alone, None: from everybody. A transport with one partner ignores it."""
        ...

    def close(self) -> None:
        """Release what the transport holds open."""
        ...


class SteadyClock:
    """Clock that begins with the time of day and follows the monotonic clock: setting the time moves nothing."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Return ns since 1970, in whole us."""
        return (self._offset_ns + time.monotonic_ns()) // US * US


class Line(SteadyClock):
    """TCP connection, or serial line: an autopilot's USB port or a telemetry radio.

    While the other end is away nothing is received, and what is sent is lost. A board on USB may come back as another
    port; its serial number finds it. `name` stays that of `url`, since it is the address to which a link is locked.

    Raises
    ------
    NoAnswer : nobody listens there. LinkError : no such host or device, or no permission to open it.
    """

    datagrams, outward = False, True

    def __init__(self, url: Url) -> None:
        super().__init__()
        self.name, self._url = str(url), url
        self._stream: Any = _open_stream(url)
        self._board = _usb_boards().get(_device(url)) if url.kind is Kind.SERIAL else None
        self._next_try_ns = 0

    def receive(self, until_ns: int) -> ReceivedBytes | None:
        """See Transport."""
        if self._stream is None:
            self._reopen(until_ns)
            return None
        try:
            data = self._read(until_ns - self.now_ns())
        except OSError:
            self.close()
            return None
        return ReceivedBytes(data, self.name, self.now_ns()) if data else None

    def send(self, data: bytes, address: str | None) -> None:
        """See Transport."""
        try:
            if self._stream is not None:
                self._stream.write(data)
        except OSError:
            self.close()

    def restrict(self, address: str | None) -> None:
        """See Transport."""

    def close(self) -> None:
        """See Transport. It must be closed at once: a board that comes back while it is open gets another port."""
        if self._stream is not None:
            self._stream.close()
        self._stream = None

    def _read(self, wait_ns: int) -> bytes:
        if not hasattr(self._stream, "fileno"):  # A serial port of Windows has no file descriptor to wait for.
            self._stream.timeout = max(wait_ns, 0) * 1e-9
            return bytes(self._stream.read(max(1, self._stream.in_waiting)))
        if not _is_readable(self._stream, wait_ns):
            return b""
        data = bytes(self._stream.read(CHUNK))
        if not data:
            raise ConnectionError("the connection was closed")
        return data

    def _reopen(self, until_ns: int) -> None:
        """Try to open it again, once in RETRY_NS; sleep between two tries, until `until_ns` at most."""
        now_ns = self.now_ns()
        if now_ns < self._next_try_ns:
            time.sleep(max(min(until_ns, self._next_try_ns) - now_ns, 0) * 1e-9)
            return
        self._next_try_ns = now_ns + RETRY_NS
        url: Url | None = self._url
        if self._board is not None:
            ports = (device for device, board in _usb_boards().items() if board == self._board)
            url = next((replace(self._url, host=port) for port in ports), None)
        with suppress(BusError):
            self._stream = _open_stream(url) if url else None


def _open_stream(url: Url) -> Any:
    """Open an unbuffered stream, whose reads and writes raise OSError once the other end is gone."""
    try:
        if url.kind is Kind.TCP:
            with socket.create_connection((url.host, url.port), CONNECT_S) as connection:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                return connection.makefile("rwb", buffering=0)
        import serial  # noqa: PLC0415

        return serial.Serial(url.host, url.port, timeout=0, write_timeout=1.0, exclusive=True)
    except (ConnectionRefusedError, TimeoutError) as error:
        remedy = "start the vehicle or its router, and check host and port"
        raise NoAnswer(f"nothing answers at {url}", remedy) from error
    except (OSError, ValueError) as error:
        raise _cannot_open(url, error) from error


def _device(url: Url) -> str:
    """Return the port's own path, to which a link such as /dev/serial/by-id leads."""
    path = Path(url.host)
    return str(path.resolve()) if path.exists() else url.host


def _usb_boards() -> dict[str, tuple[int, int, str]]:
    """Return vendor, product and serial number of the boards on USB, by the port that each has now."""
    from serial.tools.list_ports import comports  # noqa: PLC0415

    return {p.device: (p.vid, p.pid, p.serial_number) for p in comports() if p.vid and p.serial_number}


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
        if not _is_readable(self._socket, until_ns - self.now_ns()):
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


def open_transport(url: Url) -> Transport:
    """Open the transport that a URL names.

    Raises
    ------
    NoAnswer, LinkError : it cannot be opened.
    """
    return Udp(url) if url.kind in (Kind.UDP, Kind.UDPOUT) else Line(url)


def _host_port(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    return host, int(port)


def _is_readable(channel: Any, wait_ns: int) -> bool:
    return bool(select.select([channel], [], [], max(wait_ns, 0) * 1e-9)[0])


def _cannot_open(url: Url, error: Exception) -> LinkError:
    remedy = "check that it is plugged in, that no other program uses it, and that you may open it"
    if url.kind is not Kind.SERIAL:
        remedy = "check host and port, and that no other ground station listens there"
    return LinkError(f"{url} cannot be opened ({_cause(error)})", remedy)


def _cause(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number in (errno.EAGAIN, errno.EBUSY):
        return "another program uses it"
    return str(error) if number is None or number < 0 else os.strerror(number)
