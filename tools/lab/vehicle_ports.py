"""Real ports that a simulated vehicle speaks over: UDP, TCP, a pseudo-terminal."""

from __future__ import annotations

import os
import pty
import select
import socket
import tty
from contextlib import suppress
from pathlib import Path

from mpucal.errors import LinkError

CHUNK = 65536


class StationPort:
    """Where stations are; what is sent where none is is lost.

    Attributes
    ----------
    name : what a station gives to --mavlink. datagrams : what it receives comes in whole packets.
    """

    name = ""
    datagrams = False

    def send(self, data: bytes) -> None:
        """To every station that is there."""

    def receive(self) -> list[bytes]:
        """What stations sent meanwhile."""
        return []

    def plug(self, there: bool = True) -> None:
        """Have it there, or gone, as a board on USB is gone while it boots."""

    def close(self) -> None:
        """Let go of it."""


class UdpPort(StationPort):
    """Sends to one station's UDP port, as a vehicle's telemetry does, and hears whoever answers."""

    datagrams = True

    def __init__(self, host: str, port: int) -> None:
        self._station = (host, port)
        self.name = f"udp:{host}:{port}"
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, data: bytes) -> None:
        """See StationPort."""
        with suppress(OSError):
            self._socket.sendto(data, self._station)

    def receive(self) -> list[bytes]:
        """See StationPort."""
        received: list[bytes] = []
        with suppress(OSError):
            while True:
                received.append(self._socket.recvfrom(CHUNK)[0])
        return received

    def close(self) -> None:
        """See StationPort."""
        self._socket.close()


class TcpPort(StationPort):
    """Listens on a TCP port, as a SITL does; any number of stations.

    Raises
    ------
    LinkError : the port is taken.
    """

    def __init__(self, host: str, port: int) -> None:
        try:
            self._server = socket.create_server((host, port))
        except OSError as error:
            raise LinkError(f"TCP port {port} cannot be listened on ({error.strerror})", "take another") from error
        self._server.setblocking(False)
        self.name = "tcp:{}:{}".format(*self._server.getsockname()[:2])
        self._stations: list[socket.socket] = []

    def send(self, data: bytes) -> None:
        """See StationPort."""
        for station in self._stations:
            with suppress(OSError):
                station.sendall(data)

    def receive(self) -> list[bytes]:
        """See StationPort."""
        received: list[bytes] = []
        ready, _, _ = select.select([self._server, *self._stations], [], [], 0)
        for channel in ready:
            if channel is self._server:
                self._stations.append(self._server.accept()[0])
                continue
            data = b""
            with suppress(OSError):
                data = channel.recv(CHUNK)
            if data:
                received.append(data)
            else:
                channel.close()
                self._stations.remove(channel)
        return received

    def close(self) -> None:
        """See StationPort."""
        for channel in (*self._stations, self._server):
            channel.close()


class PtyPort(StationPort):
    """A pseudo-terminal, which a station opens as its serial port.

    Parameters
    ----------
    link : a path that leads to it, as /dev/serial/by-id does to a board on USB, and to another one each time that it is
        plugged in. None: it stays.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._link = link
        self._ends: tuple[int, int] | None = None
        self.name = self._open() if link is None else str(link)
        self.plug()

    def plug(self, there: bool = True) -> None:
        """See StationPort; it is always there where no link leads to it."""
        if self._link is None or there == (self._ends is not None):
            return
        if there:
            self._link.symlink_to(self._open())
        else:
            self.close()

    def _open(self) -> str:
        self._ends = master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        return os.ttyname(slave)

    def send(self, data: bytes) -> None:
        """See StationPort."""
        if self._ends is not None:
            with suppress(OSError):
                os.write(self._ends[0], data)

    def receive(self) -> list[bytes]:
        """See StationPort."""
        if self._ends is None or not select.select([self._ends[0]], [], [], 0)[0]:
            return []
        with suppress(OSError):
            return [os.read(self._ends[0], CHUNK)]
        return []

    def close(self) -> None:
        """See StationPort."""
        for end in self._ends or ():
            os.close(end)
        self._ends = None
        if self._link is not None:
            self._link.unlink(missing_ok=True)
