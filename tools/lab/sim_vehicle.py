"""A simulated vehicle on a real port, for trying `mpucal session --mavlink` without one.

    python -m tools.lab sim_vehicle udp:127.0.0.1:14550 firmware=px4 &
    mpucal session --mavlink udp:127.0.0.1:14550

    python -m tools.lab sim_vehicle tcp:127.0.0.1:5760     # listens; mpucal session --mavlink tcp:127.0.0.1:5760
    python -m tools.lab sim_vehicle pty                    # says which device

It prints the station's --mavlink on its first line, then runs until it is stopped. Everything else is KEY=VALUE: the
vehicle's keys (an unknown one lists them) and its parameters' first values. Further options of a link:

    fault=loss fault=reboot@30                         # those of docs/mavlink.md; @ begins at so many seconds
    refuse=INS_ACCSCAL_Y                               # a parameter that it will not set
"""

import os
import pty
import sys
import time
import tty
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, NoReturn

from pymavlink import mavutil

from mpucal.errors import LinkError, MpucalError, UsageError
from mpucal.mavlink.url import read_key
from mpucal.simulated.vehicle import SimulatedVehicle, VehicleOptions
from mpucal.simulated.vehicle.transport import PacketLine

STEP_S, LONGEST_STEP_S = 0.002, 0.1
CHUNK = 65536


class PtyPort:
    """A pseudo-terminal, which a station opens as its serial port."""

    def __init__(self) -> None:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(slave)

    def write(self, data: bytes) -> None:
        """Write to the line."""
        with suppress(OSError):
            os.write(self._master, data)

    def recv(self, count: int) -> bytes:
        """Return what was written to the line since."""
        with suppress(OSError):
            return os.read(self._master, count)
        return b""


def open_port(text: str) -> tuple[Any, str]:
    """Open the port that `text` names; return it, and what a station gives to --mavlink.

    Raises
    ------
    UsageError : it names none. LinkError : it is taken.
    """
    kind, _, where = text.partition(":")
    host, _, number = where.rpartition(":")
    if text == "pty":
        port = PtyPort()
        return port, port.name
    if kind not in ("udp", "tcp") or not host or not number.isdecimal():
        raise UsageError(f"{text} is no port", "give udp:HOST:PORT, tcp:HOST:PORT or pty")
    if kind == "udp":
        return mavutil.mavudp(where, input=False), text
    try:
        port = mavutil.mavtcpin(where)
    except OSError as error:
        raise LinkError(f"TCP port {number} cannot be listened on ({error.strerror})", "take another") from error
    return port, "tcp:{}:{}".format(*port.listen.getsockname())


def run(vehicle: SimulatedVehicle, port: Any, datagrams: bool, speed: float) -> NoReturn:
    """Simulate the vehicle as time goes on, until Ctrl-C."""
    passed_s, last = 0.0, time.monotonic()
    line = PacketLine(vehicle.options.fault, vehicle.options.seed)
    while True:
        time.sleep(STEP_S)
        now = time.monotonic()
        # on a busy machine the simulated time stops, instead of arriving in a burst
        passed_s += min(now - last, LONGEST_STEP_S) * speed
        last = now
        while data := port.recv(CHUNK):
            vehicle.receive(data, datagrams)
        for data in line.carry(vehicle.run_until(round(passed_s * 1e6))):
            port.write(data)


def main(
    port: Annotated[str, "udp:HOST:PORT, tcp:HOST:PORT or pty"],
    words: Annotated[Sequence[str], "KEY=VALUE"] = (),
    *,
    signing_key: Annotated[Path | None, "file of 32 bytes: it signs, and hears nobody who does not"] = None,
    speed: Annotated[float, "how much faster than real its time runs"] = 1.0,
) -> int:
    """Run the vehicle; return the exit code."""
    try:
        options = VehicleOptions.parse(":".join(["sim", ",".join(words)]).rstrip(":"))
        key = None if signing_key is None else read_key(signing_key)
        opened, name = open_port(port)
        print(name, flush=True)
        run(SimulatedVehicle(options, key=key), opened, port.startswith("udp"), speed)
    except MpucalError as error:
        print(f"sim_vehicle: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return 0
