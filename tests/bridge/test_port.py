"""Port on the real pyserial, with a pseudo-terminal and a socket."""

import contextlib
import errno
import os
import socket
from pathlib import Path

import pytest
import serial
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.link import Link
from mpucal.bridge.port import BAUDS, SerialPort, split_port
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.errors import BusError, UsageError
from mpucal.sources.chip import CAN_FORK


@pytest.mark.parametrize(
    ("text", "name", "bauds"),
    [
        ("COM3:1000000", "COM3", (1_000_000,)),
        ("/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0", "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0", BAUDS),
        ("socket://127.0.0.1:5000", "socket://127.0.0.1:5000", BAUDS[:1]),
        ("/dev/ttyUSB0:0", "/dev/ttyUSB0:0", BAUDS),
    ],
    ids=["Windows", "a colon in the name", "URL", "no rate"],
)
def test_a_port_and_its_rate(text, name, bauds):
    assert split_port(text) == (name, bauds)


@pytest.mark.parametrize("can_fork", [True, False], ids=["process", "thread"])
def test_the_driver_runs_through_the_real_pyserial(rig, serve, stream, monkeypatch, can_fork, check_numbered):
    monkeypatch.setattr("mpucal.bridge.port.CAN_FORK", can_fork and CAN_FORK)
    made = rig()
    bus = BridgeBus(SerialPort(serve(made.line.device, made.clock).name))
    driver = Driver(bus, Config(rate_hz=1000))
    driver.start()
    stream(driver, 1)
    driver.stop()
    bus.close()
    recording = driver.recording()
    check_numbered(recording, gaps=0)
    # The bridge's time goes on while this process waits for a processor.
    assert len(recording) > 100


@pytest.mark.parametrize("can_fork", [True, False], ids=["process", "thread"])
def test_a_port_that_goes_away_and_comes_back(rig, serve, stream, tmp_path, monkeypatch, can_fork):
    """A cable is plugged in again: the name stays, and the device behind it is new."""
    monkeypatch.setattr("mpucal.bridge.port.CAN_FORK", can_fork and CAN_FORK)
    made = rig()
    first, name = serve(made.line.device, made.clock), tmp_path / "ttyUSB0"
    name.symlink_to(first.name)
    driver = Driver(BridgeBus(SerialPort(str(name))), Config(rate_hz=200))
    driver.start()
    stream(driver, 1)
    second = serve(made.new_bridge(), made.clock)
    name.unlink()
    name.symlink_to(second.name)
    first.stop()
    stream(driver, 2)
    recording = driver.recording()
    assert recording.gap.sum() == 1
    assert len(recording) > 100


def test_a_port_that_is_in_use_is_refused(rig, serve):
    made = rig()
    name = serve(made.line.device, made.clock).name
    first = SerialPort(name)
    with pytest.raises(BusError, match=f"another program uses {name}: close it"):
        SerialPort(name)
    first.close()
    first.close()
    SerialPort(name).close()


@pytest.mark.parametrize(
    ("text", "what", "kind"),
    [
        ("", "no serial port was named", UsageError),
        ("/dev/there-is-none", "there is no serial port /dev/there-is-none", BusError),
        ("/dev/null", r"/dev/null is not a serial port \(Inappropriate ioctl for device\)", BusError),
        ("/", r"/ is not a serial port \(Is a directory\)", BusError),
    ],
    ids=["no name", "missing", "no terminal", "a folder"],
)
def test_the_ports_are_listed_where_the_name_is_wrong(monkeypatch, text, what, kind):
    listed = [ListPortInfo(f"/dev/tty{name}") for name in ("USB0", "ACM0", "S0")]
    for port, port.description in zip(listed, ("CP2102", "Uno"), strict=False):
        port.hwid = "USB"
    remedies = {r"connect the bridge \(no serial": [], r"use one of \S*M0 \(Uno\), \S*B0 \(CP2102\)\.$": listed}
    for remedy, ports in remedies.items():
        monkeypatch.setattr(list_ports, "comports", lambda ports=ports: ports)
        with pytest.raises(kind, match=f"^{what}: {remedy}"):
            SerialPort(text)


@pytest.mark.parametrize(
    ("failure", "words"),
    [
        (
            serial.SerialException(errno.EACCES, "could not open port: [Errno 13] Permission denied"),
            "no permission .*dialout",
        ),
        (serial.SerialException(errno.EBUSY, "could not open port: [Errno 16] busy"), "another program uses"),
        (
            serial.SerialException(errno.EIO, "could not open port: [Errno 5] Input/output error"),
            r"cannot open .*\(Input/output",
        ),
        (ValueError("Invalid baud rate: 123"), r"is not a serial port \(Invalid baud rate: 123\)"),
    ],
    ids=["EACCES", "EBUSY", "EIO", "baud"],
)
def test_each_reason_that_a_port_cannot_be_opened_is_reported(monkeypatch, failure, words):
    def refuse(*arguments, **how):
        raise failure

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(BusError, match=words) as caught:
        SerialPort("/dev/ttyUSB0")
    assert caught.value.__cause__ is failure


def test_a_socket_without_a_server_is_reported():
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        name = f"socket://127.0.0.1:{bound.getsockname()[1]}"
        with pytest.raises(BusError, match=rf"cannot connect to {name} \(Connection refused\): check the address"):
            SerialPort(name)


def test_a_port_without_a_bridge_is_closed_again(monkeypatch):
    def nobody(link, address):
        raise BusError("nothing answers", "plug it in")

    monkeypatch.setattr(Link, "greet", nobody)
    host, there = os.openpty()
    name = os.ttyname(there)
    with pytest.raises(BusError, match="nothing answers"):
        BridgeBus(SerialPort(name))
    assert opened(name) == 1
    os.close(host)
    os.close(there)


def opened(name):
    """Count the handles of this process on a terminal."""
    found = 0
    for handle in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):
            found += handle.readlink() == Path(name)
    return found
