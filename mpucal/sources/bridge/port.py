"""A serial port on pyserial, read by a thread of its own.

The thread takes bytes as they come, so that a host that computes for a while loses none.
"""

from __future__ import annotations

import queue
import select
import time
from contextlib import suppress
from threading import Event, Thread
from typing import TYPE_CHECKING, NamedTuple, Protocol

from ...errors import BusError, UsageError
from .port_errors import another, gone, opening_error

if TYPE_CHECKING:
    from serial import Serial

# What a bridge runs at, and what it runs at where that is too fast for it
BAUDS = (500_000, 115_200)
WAKE_S = 0.05
CHUNK_BYTES = 4096
# minutes of a bridge's: who leaves more than that unread is flooded
UNREAD_CHUNKS = 1 << 14
REOPEN_S = 0.25


class Chunk(NamedTuple):
    """Bytes that came, and when by the host's clock."""

    data: bytes
    t_ns: int


class Port(Protocol):
    """Bytes to a bridge and back, and the host's time; every method raises BusError where the port is gone.

    Attributes
    ----------
    name : what a person calls it. bauds : the rates at which to look for a bridge, in order.
    """

    name: str
    bauds: tuple[int, ...]

    def now_ns(self) -> int:
        """The host's clock."""
        ...

    def read(self, until_ns: int) -> Chunk | None:
        """What has come; waits for it until the host's clock shows `until_ns`, then None."""
        ...

    def write(self, data: bytes) -> None:
        """Send `data`."""
        ...

    def set_baud(self, baud: int) -> None:
        """Go on at another rate."""
        ...

    def reopen(self, until_ns: int) -> None:
        """Open it anew, after it was gone; tries until the host's clock shows `until_ns`."""
        ...

    def revive(self, until_ns: int) -> None:
        """Start again what answers there no longer, where that is the port's to start."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class SerialPort:
    """A port that pyserial opens: a device's name, or a URL such as socket://host:port.

    Parameters
    ----------
    text : PORT[:BAUD], or a URL. bauds : the rates to try where it names none.

    Raises
    ------
    UsageError : no port is named. BusError : no such port, no permission, or taken.
    """

    def __init__(self, text: str, bauds: tuple[int, ...] = BAUDS) -> None:
        if not text:
            raise UsageError("no serial port was named", another())
        self.name, self.bauds = split(text, bauds)
        self._chunks: queue.SimpleQueue[Chunk | BusError] = queue.SimpleQueue()
        self._closing = Event()
        self._thread: Thread | None = None
        self._open()

    def now_ns(self) -> int:
        """The monotonic clock."""
        return time.monotonic_ns()

    def read(self, until_ns: int) -> Chunk | None:
        """See Port."""
        try:
            got = self._chunks.get(timeout=max(0, until_ns - time.monotonic_ns()) * 1e-9)
        except queue.Empty:
            return None
        if isinstance(got, BusError):
            # whoever asks again hears it again
            self._chunks.put(got)
            raise got
        return got

    def write(self, data: bytes) -> None:
        """See Port."""
        try:
            self._serial.write(data)
        except OSError as error:
            raise gone(self.name) from error

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
        """See Port; what is there starts by itself."""

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
        # an FTDI adapter holds bytes back for 16 ms unless it is told not to
        with suppress(AttributeError, NotImplementedError, OSError, ValueError):
            self._serial.set_low_latency_mode(True)
        self._chunks = queue.SimpleQueue()
        self._closing = Event()
        self._thread = Thread(
            target=_take, args=(self._serial, self._chunks, self._closing, self.name), name=self.name, daemon=True
        )
        self._thread.start()


def split(text: str, bauds: tuple[int, ...] = BAUDS) -> tuple[str, tuple[int, ...]]:
    """PORT[:BAUD] as the port's name and the rates to try; a URL has no rate."""
    name, colon, baud = text.rpartition(":")
    if colon and "://" not in text and baud.isdecimal() and int(baud) > 0:
        return name, (int(baud),)
    return text, bauds[:1] if "://" in text else bauds


def _take(serial: Serial, chunks: queue.SimpleQueue[Chunk | BusError], closing: Event, name: str) -> None:
    """Read until the port is closed or gone."""
    try:
        while not closing.is_set():
            if chunks.qsize() >= UNREAD_CHUNKS:
                closing.wait(WAKE_S)
                continue
            data = _wait(serial)
            if data:
                chunks.put(Chunk(data, time.monotonic_ns()))
    except (OSError, ValueError, TypeError) as error:
        # pyserial's own names for a port that was unplugged or closed meanwhile
        failure = gone(name)
        failure.__cause__ = error
        chunks.put(failure)


def _wait(serial: Serial) -> bytes:
    """What has come, or nothing after WAKE_S."""
    try:
        handle = serial.fileno()
    except (AttributeError, OSError):
        # no file to wait for: Windows, rfc2217://
        serial.timeout = WAKE_S
        return bytes(serial.read(max(1, serial.in_waiting)))
    ready, _, _ = select.select([handle], [], [], WAKE_S)
    return bytes(serial.read(CHUNK_BYTES)) if ready else b""
