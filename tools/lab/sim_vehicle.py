"""A simulated vehicle on a real port, for trying `mpucal session --mavlink` without one.

    python -m tools.lab sim_vehicle udp:127.0.0.1:14550 firmware=px4 &
    mpucal session --mavlink udp:127.0.0.1:14550

    python -m tools.lab sim_vehicle tcp:127.0.0.1:5760     # listens; mpucal session --mavlink tcp:127.0.0.1:5760
    python -m tools.lab sim_vehicle pty                    # says which device
    python -m tools.lab sim_vehicle pty:/tmp/by-id         # leads to it; a reboot makes it another device

It prints the station's --mavlink on its first line, then runs until it is stopped. Everything else is KEY=VALUE: the
vehicle's keys (an unknown one lists them) and its parameters' first values. What a station has to live with:

    fault=loss fault=reboot@30                         # all are listed below; @ begins at so many seconds
    refuse=INS_ACCSCAL_Y                               # a parameter that it will not set
    --vehicles 2                                       # the others are systems of their own, at ports of their own
    --stranger                                         # 50 forged RAW_IMU and 50 truncated packets a second
    --signing-key FILE                                 # it signs, and hears nobody who does not
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from mpucal.errors import MpucalError, UsageError
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.signing import read_key
from mpucal.simulated.faults import OF_VEHICLE, Where, kinds
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.line import PacketLine

from .vehicle_ports import PtyPort, StationPort, TcpPort, UdpPort

STEP_S = 0.002
STRANGER_US = 20_000
LONGEST_STEP_S = 0.1


def main() -> int:
    """Run it; the exit code."""
    faults = "\n".join(f"  {name:<16}{kind.what}" for name, kind in kinds(*OF_VEHICLE, Where.HAND).items())
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=f"faults:\n{faults}", formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("port", metavar="udp:HOST:PORT|tcp:HOST:PORT|pty[:LINK]")
    parser.add_argument("words", metavar="KEY=VALUE", nargs="*")
    parser.add_argument("--vehicles", type=int, default=1, help="how many (udp)")
    parser.add_argument("--stranger", action="store_true", help="send forged and truncated packets (udp)")
    parser.add_argument("--signing-key", metavar="FILE", type=Path, help="32 bytes to sign with")
    parser.add_argument("--speed", type=float, default=1.0, help="how much faster than real its time runs")
    arguments = parser.parse_args()
    ports: list[StationPort] = []
    try:
        options = VehicleOptions.parse(":".join(["sim", ",".join(arguments.words)]).rstrip(":"))
        key = None if arguments.signing_key is None else read_key(arguments.signing_key)
        riders: list[Ride | Stranger] = []
        for number in range(arguments.vehicles):
            vehicle = SimulatedVehicle(
                replace(options, system=options.system + number, seed=options.seed + number), key=key
            )
            ports.append(open_port(arguments.port))
            riders.append(Ride(vehicle, ports[-1]))
        if arguments.stranger:
            ports.append(open_port(arguments.port))
            riders.append(Stranger(ports[-1], options.system))
        print(ports[0].name, flush=True)
        run(riders, arguments.speed)
    except MpucalError as error:
        print(f"sim_vehicle: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return 0
    finally:
        for port in ports:
            port.close()


def open_port(text: str) -> StationPort:
    """What `text` names."""
    kind, _, rest = text.partition(":")
    host, _, number = rest.rpartition(":")
    if kind == "pty":
        return PtyPort(Path(rest) if rest else None)
    if kind in ("udp", "tcp") and host and number.isdecimal():
        return UdpPort(host, int(number)) if kind == "udp" else TcpPort(host, int(number))
    raise UsageError(f"{text} is no port", "give udp:HOST:PORT, tcp:HOST:PORT, pty or pty:LINK")


class Ride:
    """A vehicle on a port."""

    def __init__(self, vehicle: SimulatedVehicle, port: StationPort) -> None:
        self._vehicle, self._port = vehicle, port
        self._line = PacketLine(vehicle.options.fault, vehicle.options.seed)

    def go_on(self, until_us: int) -> None:
        """Hear what came, and live until `until_us`."""
        self._port.plug(not self._vehicle.silent)
        for data in self._port.receive():
            self._vehicle.hear(data, self._port.datagrams)
        for data in self._line.carry([packet.data for packet in self._vehicle.go_on(until_us)]):
            self._port.send(data)


class Stranger:
    """Somebody else on the network, who sends what the vehicle's `system` would, and parts of it."""

    def __init__(self, port: StationPort, system: int) -> None:
        self._port = port
        self._mav = dialect().MAVLink(None, system, 1)
        self._sent = 0

    def go_on(self, until_us: int) -> None:
        """A forged RAW_IMU and a truncated one, each 20 ms."""
        while self._sent * STRANGER_US < until_us:
            forged = (
                dialect().MAVLink_raw_imu_message(until_us, 999, -999, 999, 999, -999, 999, 0, 0, 0).pack(self._mav)
            )
            self._port.send(forged)
            self._port.send(forged[:17])
            self._sent += 1


def run(riders: Sequence[Ride | Stranger], speed: float) -> NoReturn:
    """Let them live as time goes on, until Ctrl-C."""
    passed_s, last = 0.0, time.monotonic()
    while True:
        time.sleep(STEP_S)
        now = time.monotonic()
        # on a machine that is too busy its time stands still, rather than to come in a burst
        passed_s += min(now - last, LONGEST_STEP_S) * speed
        last = now
        for rider in riders:
            rider.go_on(round(passed_s * 1e6))
