"""The share of a processor that a vehicle's link takes: three IMUs over UDP on loopback, in real time.

    python -m tools.bench link_load                 # 333 Hz, the most that ArduPilot gives, for 20 s
    python -m tools.bench link_load --rate 100

What is counted is this process alone, whose thread listens, decodes, records and hands out samples as a session does;
the vehicle is another process that sends prepared packets.
"""

from __future__ import annotations

import argparse
import multiprocessing
import socket
import tempfile
import time
from pathlib import Path

from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.link import Link
from mpucal.mavlink.tlog import TlogWriter
from mpucal.mavlink.transports import Udp
from mpucal.mavlink.url import Kind, Url
from mpucal.mavlink.vehicle_source import VehicleSource

from .timing import used


def vehicle(port: int, rate_hz: float) -> None:
    """Send HIGHRES_IMU, SCALED_IMU2 and SCALED_IMU3 at `rate_hz`, and HEARTBEAT; acknowledge everything."""
    m = dialect()
    mav = m.MAVLink(None, 1, 1)
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.connect(("127.0.0.1", port))
    line.setblocking(False)
    begun = time.monotonic()
    sent = 0
    while True:
        t_us = round(sent / rate_hz * 1e6)
        fields = (120, -40, -1000, 30, 20, 10, 0, 0, 0)
        messages = [m.MAVLink_highres_imu_message(t_us, 1, 2, -9.8, 0.1, 0.2, 0.3, *[0] * 6, 25.0, 0xFFFF)]
        messages += [m.MAVLink_scaled_imu2_message(t_us // 1000, *fields)]
        messages += [m.MAVLink_scaled_imu3_message(t_us // 1000, *fields)]
        if sent % round(rate_hz) == 0:
            messages += [m.MAVLink_heartbeat_message(2, m.MAV_AUTOPILOT_ARDUPILOTMEGA, 81, 0, 3, 3)]
        messages += [m.MAVLink_command_ack_message(m.MAV_CMD_SET_MESSAGE_INTERVAL, 0)] * asked(line, mav)
        for message in messages:
            line.send(message.pack(mav))
            mav.seq = (mav.seq + 1) % 256
        sent += 1
        time.sleep(max(begun + sent / rate_hz - time.monotonic(), 0.0))


def asked(line: socket.socket, mav: object) -> int:
    """Return how many commands arrived."""
    count = 0
    while True:
        try:
            count += mav.decode(bytearray(line.recv(300))).get_type() == "COMMAND_LONG"  # type: ignore[attr-defined]
        except (BlockingIOError, ConnectionRefusedError):
            return count


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=float, default=333.0, metavar="HZ")
    parser.add_argument("--seconds", type=float, default=20.0)
    arguments = parser.parse_args()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    sender = multiprocessing.get_context("spawn").Process(target=vehicle, args=(port, arguments.rate), daemon=True)
    with tempfile.TemporaryDirectory() as folder, TlogWriter(Path(folder) / "capture.tlog") as writer:
        link = Link(Udp(Url(Kind.UDP, "127.0.0.1", port)), writer.packet)
        source = VehicleSource(link, arguments.rate, None, lambda text: None, "load")
        sender.start()
        try:
            source.start()
            samples, until_s = 0, time.monotonic() + arguments.seconds
            with used() as found:
                while time.monotonic() < until_s:
                    samples += len(source.poll())
        finally:
            sender.kill()
            link.close()
    share = 100 * found.cpu_s / found.wall_s
    print(f"3 IMUs at {samples / found.wall_s:.0f} Hz: {share:.1f} % of one processor, {link.lost} packets lost")
