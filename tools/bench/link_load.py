"""The share of a processor that a vehicle's link takes: three IMUs over UDP on loopback, in real time.

    python -m tools.bench link_load                 # 333 Hz, the most that ArduPilot gives, for 20 s
    python -m tools.bench link_load --rate 100

Only this process counts; it receives, decodes, records and hands out samples as a session does. The vehicle is
tools/lab/sim_vehicle.py.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

from mpucal.files.capture_writer import CaptureWriter
from mpucal.files.messages import PACKETS
from mpucal.mavlink.link import Link
from mpucal.mavlink.transports import open_transport
from mpucal.mavlink.url import parse_url
from mpucal.mavlink.vehicle_source import VehicleSource

from .timing import used

ROOT = Path(__file__).parents[2]
URL = "udp:127.0.0.1:24550"


def main(*, rate: Annotated[float, "Hz"] = 333.0, seconds: float = 20.0) -> None:
    """Measure and print."""
    words = [sys.executable, "-m", "tools.lab", "sim_vehicle", URL, "imus=3"]
    with (
        subprocess.Popen(words, stdout=subprocess.DEVNULL, cwd=ROOT) as vehicle,
        tempfile.TemporaryDirectory() as folder,
        CaptureWriter(Path(folder) / "capture.mcap") as writer,
    ):
        writer.start({}, PACKETS)
        link = Link(open_transport(parse_url(URL)), writer.packet)
        source = VehicleSource(link, rate, None, lambda text: None, "load")
        try:
            source.start()
            samples, until_s = 0, time.monotonic() + seconds
            with used() as found:
                while time.monotonic() < until_s:
                    samples += len(source.poll())
        finally:
            vehicle.kill()
            link.close()
    share = 100 * found.cpu_s / found.wall_s
    print(f"3 IMUs at {samples / found.wall_s:.0f} Hz: {share:.1f} % of one processor, {link.lost} packets lost")
