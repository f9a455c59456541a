"""Serial port of pyserial, read by a process or thread of its own, so that no bytes are lost while the host computes.

A process is scheduled by itself, however busy the session is, and the time of an arrival is that of the read. Systems
other than Linux, and ports without a file descriptor, have a thread.
"""

from __future__ import annotations

import errno
import os
import queue
import select
import signal
import time
from collections import deque
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, NamedTuple, Protocol

from ..errors import BusError, UsageError
from ..sources.chip import CAN_FORK
from .port_errors import opening_error, other_ports, port_gone

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from serial import Serial

# Rate of a bridge, and of one for which that is too fast.
BAUDS = (500_000, 115_200)
WAKE_S = 0.05
CHUNK_BYTES = 4096
# Several minutes of a bridge's bytes: a port with more unread ones is flooded.
UNREAD_CHUNKS = 1 << 14
REOPEN_S = 0.25
# Errors of pyserial for a port that was unplugged or closed.
GONE = (OSError, ValueError, TypeError)


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

    def read(self, until_ns: int) -> Chunk | None:
        """Return received bytes; wait for them until the host's clock shows `until_ns`, then return None."""

    def write(self, data: bytes) -> None:
        """Write `data`."""

    def set_baud(self, baud: int) -> None:
        """Change the rate."""

    def reopen(self, until_ns: int) -> None:
        """Open a port that was gone again, with retries until the host's clock shows `until_ns`."""

    def revive(self, until_ns: int) -> None:
        """Restart the program behind the port if the port itself started it."""

    def close(self) -> None:
        """Close the port."""


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
        self._failure: BusError | None = None
        self._open()

    def now_ns(self) -> int:
        """Return the time of the monotonic clock."""
        return time.monotonic_ns()

    def read(self, until_ns: int) -> Chunk | None:
        """See Port."""
        got = self._failure or self._reader.get(max(0, until_ns - time.monotonic_ns()) * 1e-9)
        if isinstance(got, BusError):
            self._failure = got
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
        self._reader.close()
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
        self._failure = None
        handle = _handle(self._serial) if CAN_FORK else None
        self._reader = ThreadReader(self._serial, self.name) if handle is None else ProcessReader(handle, self.name)


def split_port(text: str, bauds: tuple[int, ...] = BAUDS) -> tuple[str, tuple[int, ...]]:
    """Split PORT[:BAUD] into the port's name and the rates to try; a URL has no rate."""
    name, colon, baud = text.rpartition(":")
    if colon and "://" not in text and baud.isdecimal() and int(baud) > 0:
        return name, (int(baud),)
    return text, bauds[:1] if "://" in text else bauds


class ThreadReader:
    """Reader in a thread; see Reader."""

    def __init__(self, serial: Serial, name: str) -> None:
        self._serial, self._name = serial, name
        self._chunks: queue.SimpleQueue[Chunk | BusError] = queue.SimpleQueue()
        self._closing = Event()
        self._thread = Thread(target=self._read, name=name, daemon=True)
        self._thread.start()

    def get(self, timeout_s: float) -> Chunk | BusError | None:
        """See Reader."""
        with suppress(queue.Empty):
            return self._chunks.get(timeout=timeout_s)
        return None

    def close(self) -> None:
        """See Reader."""
        self._closing.set()
        self._thread.join()

    def _read(self) -> None:
        try:
            while not self._closing.is_set():
                if self._chunks.qsize() >= UNREAD_CHUNKS:
                    self._closing.wait(WAKE_S)
                elif data := _read_available(self._serial):
                    self._chunks.put(Chunk(data, time.monotonic_ns()))
        except GONE as error:
            self._chunks.put(_gone(self._name, error))


class ProcessReader:
    """Reader of a file descriptor in a process, which ends with this one; see Reader."""

    def __init__(self, handle: int, name: str) -> None:
        from ..sources.reading_process import start_reading  # noqa: PLC0415 - for an open port alone

        self._name = name
        self._arrived: deque[Chunk | BusError] = deque()
        self._process, self._pid = start_reading(partial(_read_apart, handle, name))

    def get(self, timeout_s: float) -> Chunk | BusError | None:
        """See Reader."""
        try:
            if not self._arrived and self._process.poll(timeout_s):
                self._arrived.extend(self._process.recv())
        except (EOFError, OSError) as error:
            return _gone(self._name, error)
        return self._arrived.popleft() if self._arrived else None

    def close(self) -> None:
        """See Reader."""
        if not self._process.closed:
            os.kill(self._pid, signal.SIGKILL)
            os.waitpid(self._pid, 0)
            self._process.close()


def _read_apart(handle: int, name: str, session: Connection) -> None:
    """Read in a process, and send the bytes to the session, until that has ended."""
    from ..sources.reading_process import Outbox  # noqa: PLC0415 - loaded before the fork

    # The session's other files and sockets would stay open here after the session has closed them.
    for path in [*Path("/proc/self/fd").iterdir()]:
        if int(path.name) not in (0, 1, 2, handle, session.fileno()):
            with suppress(OSError):
                os.close(int(path.name))
    with closing(Outbox(session)) as outbox:
        try:
            while session.fileno() not in select.select([handle, session.fileno()], [], [])[0]:
                if outbox.unsent >= UNREAD_CHUNKS:
                    time.sleep(WAKE_S)
                    continue
                with suppress(BlockingIOError):
                    if not (data := os.read(handle, CHUNK_BYTES)):
                        raise OSError(errno.EIO, os.strerror(errno.EIO))
                    outbox.put(Chunk(data, time.monotonic_ns()))
                    outbox.send()
        except OSError as error:
            outbox.put(_gone(name, error))


def _gone(name: str, error: Exception) -> BusError:
    gone = port_gone(name)
    gone.__cause__ = error
    return gone


def _handle(serial: Serial) -> int | None:
    """Return the file descriptor; None on Windows and for rfc2217://."""
    with suppress(AttributeError, OSError):
        return int(serial.fileno())
    return None


def _read_available(serial: Serial) -> bytes:
    """Read the received bytes; return none after WAKE_S."""
    handle = _handle(serial)
    if handle is None:
        serial.timeout = WAKE_S
        return bytes(serial.read(max(1, serial.in_waiting)))
    ready, _, _ = select.select([handle], [], [], WAKE_S)
    return bytes(serial.read(CHUNK_BYTES)) if ready else b""
