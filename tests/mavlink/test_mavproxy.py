"""MAVProxy between the vehicle and mpucal, where it is installed."""

import contextlib
import shutil
import socket
import subprocess

import pytest

import mpucal
from mpucal.errors import NoAnswer
from mpucal.mavlink.link import Link
from mpucal.mavlink.transports import Udp
from mpucal.mavlink.url import Kind, Url
from mpucal.mavlink.vehicle_source import VehicleSource

MAVPROXY = shutil.which("mavproxy.py")

pytestmark = pytest.mark.skipif(MAVPROXY is None, reason="MAVProxy is not installed (pip install MAVProxy)")


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        return line.getsockname()[1]


@contextlib.contextmanager
def running(*command, **how):
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, **how)
    try:
        yield
    finally:
        process.kill()
        process.communicate()


def test_a_vehicle_behind_mavproxy_is_measured_and_its_log_read(program, tmp_path):
    master, out = free_port(), free_port()
    link = Link(Udp(Url(Kind.UDP, "127.0.0.1", out)), lambda t_ns, data: None)
    proxy = (MAVPROXY, f"--master=udp:127.0.0.1:{master}", f"--out=udp:127.0.0.1:{out}", "--non-interactive")
    words = ("--state-basedir", str(tmp_path), "--logfile", str(tmp_path / "proxy.tlog"), "--streamrate=-1")
    vehicle = program("lab", "sim_vehicle", f"udp:127.0.0.1:{master}")
    with running(*proxy, *words, cwd=tmp_path, stderr=subprocess.DEVNULL), running(*vehicle):
        source = VehicleSource(link, 100.0, None, lambda text: None, "behind MAVProxy")
        try:
            # MAVProxy takes some seconds to load: nobody may be there at first
            with contextlib.suppress(NoAnswer):
                link.listen()
            sensor = source.start()
            samples = sum(len(source.poll()) for _ in range(100))
        finally:
            link.close()
    assert sensor.message == "HIGHRES_IMU"
    assert samples == pytest.approx(500, abs=100)
    recording = mpucal.load(tmp_path / "proxy.tlog")
    assert recording.sensor.message == "HIGHRES_IMU"
    assert len(recording.others) == 1
