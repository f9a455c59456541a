"""Serial port of pyserial, read by its own thread, so that no bytes are lost while the host computes."""

from __future__ import annotations

import queue
import select
import time
from contextlib import suppress
from threading import Event, Thread
from typing import TYPE_CHECKING, NamedTuple, Protocol

from ..errors import BusError, UsageError
from .port_errors import opening_error, other_ports, port_gone

if TYPE_CHECKING:
    from serial import Serial

# Rate of a bridge, and of one for which that is too fast.
BAUDS = (500_000, 115_200)
WAKE_S = 0.05
CHUNK_BYTES = 4096
# Several minutes of a bridge's bytes: a port with more unread ones is flooded.
UNREAD_CHUNKS = 1 << 14
REOPEN_S = 0.25


class Chunk(NamedTuple):
    """Received bytes, with the host's time of their arrival."""

    data: bytes
    t_ns: int


class Port(Protocol):
    """Transport of bytes to and from a bridge, with the host's time; methods raise BusError if the port is gone.

    Attributes
    ----------
    name : for messages. bauds : rates at which to try to reach a bridge, in order.
    """

    name: str
    bauds: tuple[int, ...]

    def now_ns(self) -> int:
        """Return the host's time."""
        ...

    def read(self, until_ns: int) -> Chunk | None:
        """Return received bytes; wait for them until the host's clock shows `until_ns`, then return None."""
        ...

    def write(self, data: bytes) -> None:
        """Write `data`."""
        ...

    def set_baud(self, baud: int) -> None:
        """Change the rate."""
        ...

    def reopen(self, until_ns: int) -> None:
        """Open a port that was gone again, with retries until the host's clock shows `until_ns`."""
        ...

    def revive(self, until_ns: int) -> None:
        """Restart the program behind the port if the port itself started it."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...


class SerialPort:
    """Port that pyserial opens by a device's name, or a URL such as socket://host:port.

    Parameters
    ----------
    text : PORT[:BAUD], or a URL. bauds : rates to try if it names none.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, no permission, or in use.
    """

    def __init__(self, text: str, bauds: tuple[int, ...] = BAUDS) -> None:
        if not text:
            raise UsageError("no serial port was named", other_ports())
        self.name, self.bauds = split_port(text, bauds)
        self._chunks: queue.SimpleQueue[Chunk | BusError] = queue.SimpleQueue()
        self._closing = Event()
        self._thread: Thread | None = None
        self._open()

    def now_ns(self) -> int:
        """Return the time of the monotonic clock."""
        return time.monotonic_ns()

    def read(self, until_ns: int) -> Chunk | None:
        """See Port."""
        try:
            got = self._chunks.get(timeout=max(0, until_ns - time.monotonic_ns()) * 1e-9)
        except queue.Empty:
            return None
        if isinstance(got, BusError):
            # The next read raises it again.
            self._chunks.put(got)
            raise got
        return got

    def write(self, data: bytes) -> None:
        """See Port."""
        try:
            self._serial.write(data)
        except OSError as error:
            raise port_gone(self.name) from error

    def set_baud(self, baud: int) -> None:
        """See Port."""
        try:
            self._serial.baudrate = baud
        except (OSError, ValueError) as error:
            raise opening_error(error, self.name) from error

    def reopen(self, until_ns: int) -> None:
        """See Port."""
        self.close()
        while True:
            try:
                return self._open()
            except BusError:
                if time.monotonic_ns() >= until_ns:
                    raise
                time.sleep(REOPEN_S)

    def revive(self, until_ns: int) -> None:
        """Do nothing: firmware starts by itself."""

    def close(self) -> None:
        """See Port."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
        with suppress(OSError):
            self._serial.close()

    def _open(self) -> None:
        import serial  # noqa: PLC0415 - only where there is a bridge

        try:
            self._serial = serial.serial_for_url(self.name, self.bauds[0], timeout=0, write_timeout=2, exclusive=True)
        except (OSError, ValueError) as error:
            raise opening_error(error, self.name) from error
        # By default an FTDI adapter holds bytes back for 16 ms.
        with suppress(AttributeError, NotImplementedError, OSError, ValueError):
            self._serial.set_low_latency_mode(True)
        self._chunks = queue.SimpleQueue()
        self._closing = Event()
        self._thread = Thread(
            target=_read_loop, args=(self._serial, self._chunks, self._closing, self.name), name=self.name, daemon=True
        )
        self._thread.start()


def split_port(text: str, bauds: tuple[int, ...] = BAUDS) -> tuple[str, tuple[int, ...]]:
    """Split PORT[:BAUD] into the port's name and the rates to try; a URL has no rate."""
    name, colon, baud = text.rpartition(":")
    if colon and "://" not in text and baud.isdecimal() and int(baud) > 0:
        return name, (int(baud),)
    return text, bauds[:1] if "://" in text else bauds


def _read_loop(serial: Serial, chunks: queue.SimpleQueue[Chunk | BusError], closing: Event, name: str) -> None:
    """Read until the port is closed or gone."""
    try:
        while not closing.is_set():
            if chunks.qsize() >= UNREAD_CHUNKS:
                closing.wait(WAKE_S)
                continue
            data = _read_available(serial)
            if data:
                chunks.put(Chunk(data, time.monotonic_ns()))
    except (OSError, ValueError, TypeError) as error:
        # These are pyserial's errors for a port that was unplugged or closed.
        failure = port_gone(name)
        failure.__cause__ = error
        chunks.put(failure)


def _read_available(serial: Serial) -> bytes:
    """Read the received bytes; return none after WAKE_S."""
    try:
        handle = serial.fileno()
    except (AttributeError, OSError):
        # There is no file descriptor on Windows and for rfc2217://.
        serial.timeout = WAKE_S
        return bytes(serial.read(max(1, serial.in_waiting)))
    ready, _, _ = select.select([handle], [], [], WAKE_S)
    return bytes(serial.read(CHUNK_BYTES)) if ready else b""
