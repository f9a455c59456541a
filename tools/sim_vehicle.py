"""A simulated vehicle on a real port, for trying `mpucal session --mavlink` without one.

    python tools/sim_vehicle.py udp:127.0.0.1:14550 firmware=px4 &
    mpucal session --mavlink udp:127.0.0.1:14550

    python tools/sim_vehicle.py tcp:127.0.0.1:5760     # listens; mpucal session --mavlink tcp:127.0.0.1:5760
    python tools/sim_vehicle.py pty                    # says which device

It prints the station's --mavlink on its first line, then runs until it is stopped, or its standard input ends.
Everything else is KEY=VALUE: the vehicle's keys (an unknown one lists them) and its parameters' first values.
"""

from __future__ import annotations

import argparse
import sys
import time

from mpucal.errors import MpucalError, UsageError
from mpucal.mavlink.simulated import Options, Vehicle
from mpucal.mavlink.simulated.line import Line
from mpucal.mavlink.simulated.ports import Port, PtyPort, TcpPort, UdpPort

STEP_S = 0.002


def main() -> int:
    """Run it; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("port", metavar="udp:HOST:PORT|tcp:HOST:PORT|pty")
    parser.add_argument("words", metavar="KEY=VALUE", nargs="*")
    parser.add_argument("--speed", type=float, default=1.0, help="how much faster than real its time runs")
    arguments = parser.parse_args()
    try:
        vehicle = Vehicle(Options.parse(":".join(["sim", ",".join(arguments.words)]).rstrip(":")))
        port = open_port(arguments.port)
    except MpucalError as error:
        print(f"sim_vehicle: {error}", file=sys.stderr)
        return error.exit_code
    print(port.name, flush=True)
    try:
        run(vehicle, port, arguments.speed)
    except KeyboardInterrupt:
        return 0
    finally:
        port.close()


def open_port(text: str) -> Port:
    """What `text` names."""
    kind, _, rest = text.partition(":")
    host, _, number = rest.rpartition(":")
    if text == "pty":
        return PtyPort()
    if kind in ("udp", "tcp") and host and number.isdecimal():
        return UdpPort(host, int(number)) if kind == "udp" else TcpPort(host, int(number))
    raise UsageError(f"{text} is no port", "give udp:HOST:PORT, tcp:HOST:PORT or pty")


def run(vehicle: Vehicle, port: Port, speed: float) -> None:
    """Let it live as time goes on, until Ctrl-C."""
    line = Line(vehicle.options.faults, vehicle.options.seed)
    begun = time.monotonic()
    while True:
        for data in port.receive(STEP_S):
            vehicle.hear(data)
        sent = vehicle.go_on(round((time.monotonic() - begun) * speed * 1e6))
        for data in line.carry([packet.data for packet in sent]):
            port.send(data)


if __name__ == "__main__":
    sys.exit(main())
