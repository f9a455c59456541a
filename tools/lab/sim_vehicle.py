"""A simulated vehicle on a real port, for trying `mpucal session --mavlink` without one.

    python -m tools.lab sim_vehicle udp:127.0.0.1:14550 firmware=px4 &
    mpucal session --mavlink udp:127.0.0.1:14550

    python -m tools.lab sim_vehicle tcp:127.0.0.1:5760     # listens; mpucal session --mavlink tcp:127.0.0.1:5760
    python -m tools.lab sim_vehicle pty                    # says which device

It prints the station's --mavlink on its first line, then runs until it is stopped. Everything else is KEY=VALUE: the
vehicle's keys (an unknown one lists them) and its parameters' first values. Further options of a link:

    fault=loss fault=reboot@30                         # all are listed below; @ begins at so many seconds
    refuse=INS_ACCSCAL_Y                               # a parameter that it will not set
    --vehicles 2                                       # the others are systems of their own, at ports of their own
    --signing-key FILE                                 # it signs, and hears nobody who does not
"""

from __future__ import annotations

import argparse
import os
import pty
import select
import socket
import sys
import time
import tty
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from mpucal.errors import LinkError, MpucalError, UsageError
from mpucal.mavlink.signing import read_key
from mpucal.simulated.faults import OF_VEHICLE, Where, fault_kinds
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.line import PacketLine

STEP_S, LONGEST_STEP_S = 0.002, 0.1
CHUNK = 65536


class UdpPort:
    """UDP port of a vehicle's telemetry: sends to one station, and receives from any.

    Attributes
    ----------
    name : what a station gives to --mavlink. datagrams : what it receives comes in whole packets.
    """

    datagrams = True

    def __init__(self, host: str, port: int) -> None:
        self._station = (host, port)
        self.name = f"udp:{host}:{port}"
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, data: bytes) -> None:
        """Send to the station; without a station the data is lost."""
        with suppress(OSError):
            self._socket.sendto(data, self._station)

    def receive(self) -> list[bytes]:
        """Return the data that stations have sent since."""
        received: list[bytes] = []
        with suppress(OSError):
            while True:
                received.append(self._socket.recvfrom(CHUNK)[0])
        return received

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class TcpPort:
    """TCP port of a SITL that listens for any number of stations. See UdpPort.

    Raises
    ------
    LinkError : the port is taken.
    """

    datagrams = False

    def __init__(self, host: str, port: int) -> None:
        try:
            self._server = socket.create_server((host, port))
        except OSError as error:
            raise LinkError(f"TCP port {port} cannot be listened on ({error.strerror})", "take another") from error
        self._server.setblocking(False)
        self.name = "tcp:{}:{}".format(*self._server.getsockname()[:2])
        self._stations: list[socket.socket] = []

    def send(self, data: bytes) -> None:
        """Send to every station that is there."""
        for station in self._stations:
            with suppress(OSError):
                station.sendall(data)

    def receive(self) -> list[bytes]:
        """Return the data that stations have sent since; accept new stations, and drop those that left."""
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
        """Close all sockets."""
        for channel in (*self._stations, self._server):
            channel.close()


class PtyPort:
    """A pseudo-terminal, which a station opens as its serial port. See UdpPort."""

    datagrams = False

    def __init__(self) -> None:
        self._ends = self._master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(slave)

    def send(self, data: bytes) -> None:
        """Write to the line."""
        with suppress(OSError):
            os.write(self._master, data)

    def receive(self) -> list[bytes]:
        """Return the data that was written to the line since."""
        with suppress(OSError):
            return [os.read(self._master, CHUNK)]
        return []

    def close(self) -> None:
        """Close both ends."""
        for end in self._ends:
            os.close(end)


Port = UdpPort | TcpPort | PtyPort


def open_port(text: str) -> Port:
    """Open the port that `text` names.

    Raises
    ------
    UsageError : it names none.
    """
    kind, _, rest = text.partition(":")
    host, _, number = rest.rpartition(":")
    if text == "pty":
        return PtyPort()
    if kind in ("udp", "tcp") and host and number.isdecimal():
        return UdpPort(host, int(number)) if kind == "udp" else TcpPort(host, int(number))
    raise UsageError(f"{text} is no port", "give udp:HOST:PORT, tcp:HOST:PORT or pty")


class Ride:
    """A vehicle on a port."""

    def __init__(self, vehicle: SimulatedVehicle, port: Port) -> None:
        self._vehicle, self._port = vehicle, port
        self._line = PacketLine(vehicle.options.fault, vehicle.options.seed)

    def go_on(self, until_us: int) -> None:
        """Pass the received data to the vehicle, and simulate it until `until_us`."""
        for data in self._port.receive():
            self._vehicle.receive(data, self._port.datagrams)
        for data in self._line.carry([packet.data for packet in self._vehicle.run_until(until_us)]):
            self._port.send(data)


def run(rides: Sequence[Ride], speed: float) -> NoReturn:
    """Run the vehicles as time goes on, until Ctrl-C."""
    passed_s, last = 0.0, time.monotonic()
    while True:
        time.sleep(STEP_S)
        now = time.monotonic()
        # on a busy machine the simulated time stops, instead of arriving in a burst
        passed_s += min(now - last, LONGEST_STEP_S) * speed
        last = now
        for ride in rides:
            ride.go_on(round(passed_s * 1e6))


def main() -> int:
    """Run the vehicle; return the exit code."""
    faults = "\n".join(f"  {name:<16}{kind.what}" for name, kind in fault_kinds(*OF_VEHICLE, Where.HAND).items())
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=f"faults:\n{faults}", formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("port", metavar="udp:HOST:PORT|tcp:HOST:PORT|pty")
    parser.add_argument("words", metavar="KEY=VALUE", nargs="*")
    parser.add_argument("--vehicles", type=int, default=1, help="how many (udp)")
    parser.add_argument("--signing-key", metavar="FILE", type=Path, help="32 bytes to sign with")
    parser.add_argument("--speed", type=float, default=1.0, help="how much faster than real its time runs")
    asked = parser.parse_args()
    ports: list[Port] = []
    try:
        options = VehicleOptions.parse(":".join(["sim", ",".join(asked.words)]).rstrip(":"))
        key = None if asked.signing_key is None else read_key(asked.signing_key)
        ports += [open_port(asked.port) for _ in range(asked.vehicles)]
        others = [replace(options, system=options.system + n, seed=options.seed + n) for n in range(asked.vehicles)]
        print(ports[0].name, flush=True)
        run(
            [Ride(SimulatedVehicle(each, key=key), port) for each, port in zip(others, ports, strict=True)], asked.speed
        )
    except MpucalError as error:
        print(f"sim_vehicle: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return 0
    finally:
        for port in ports:
            port.close()
