"""Addresses on a bus, probed as by i2cdetect, on an adapter whose ioctls are answered in this process."""

import errno
import os
from pathlib import Path

import pytest
from smbus2 import smbus2

from mpucal.doctor import host
from mpucal.doctor.finding import Mark
from mpucal.doctor.host import examine_host


class Adapter:
    """Adapter on which 0x68 alone answers; `fails` returns the errno of a transfer with an address, 0 for none."""

    def __init__(self, fails=lambda address: 0):
        self.fails, self.asked = fails, []

    def ioctl(self, _fd, request, argument):
        if request == smbus2.I2C_FUNCS:
            argument.value = int(smbus2.I2cFunc.I2C)
        elif request == smbus2.I2C_SLAVE:
            self.asked.append(argument)
        else:
            number = self.fails(self.asked[-1]) or (0 if self.asked[-1] == 0x68 else errno.EREMOTEIO)
            if number:
                raise OSError(number, os.strerror(number))
        return 0


@pytest.fixture
def told(monkeypatch, tmp_path):
    """Return the finding about the addresses on the bus of an adapter."""
    (tmp_path / "i2c-1").touch()

    def tell(adapter):
        monkeypatch.setattr(smbus2, "ioctl", adapter.ioctl)
        findings = list(examine_host(str(tmp_path / "i2c-1")))
        return next(finding for finding in findings if finding.topic == "on the bus")

    return tell


def test_a_held_bus_is_given_up_after_three_addresses(told):
    adapter = Adapter(lambda _address: errno.ETIMEDOUT)
    finding = told(adapter)
    assert finding.mark is Mark.BAD
    assert "does not become free" in finding.what
    assert "holds SDA or SCL low" in finding.remedy
    assert len(adapter.asked) < 5


def test_one_slow_device_does_not_hide_the_others(told):
    adapter = Adapter(lambda address: errno.ETIMEDOUT if address in (0x20, 0x21, 0x40) else 0)
    assert told(adapter).data["addresses"] == [0x68]
    assert sorted(set(adapter.asked)) == list(range(0x08, 0x78))


def test_a_chip_on_another_bus_is_found(monkeypatch, tmp_path):
    """The chip's identity is read, and nothing is written there."""
    for number in (1, 3, 7):
        (tmp_path / f"i2c-{number}").touch()
    opened, written = {}, []

    def ioctl(fd, request, argument):
        path = Path(f"/proc/self/fd/{fd}").readlink().name
        if request == smbus2.I2C_FUNCS:
            argument.value = int(smbus2.I2cFunc.I2C)
        elif request == smbus2.I2C_SLAVE:
            opened[fd] = argument
        elif path == "i2c-3" and opened[fd] == 0x69 and argument.size == smbus2.I2C_SMBUS_BYTE_DATA:
            written.append(argument.read_write == smbus2.I2C_SMBUS_WRITE)
            argument.data.contents.byte = 0x70
        else:
            raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
        return 0

    monkeypatch.setattr(smbus2, "ioctl", ioctl)
    finding = next(f for f in examine_host(str(tmp_path / "i2c-1")) if f.topic == "on the bus")
    assert finding.mark is Mark.BAD
    assert finding.remedy == f"it is on another bus: give --bus {tmp_path / 'i2c-3'}"
    assert written == [False]


@pytest.mark.parametrize(("driver", "mark", "says"), [("rtc-ds1307", Mark.NOTE, "0x69"), ("mpu", Mark.BAD, "unbind")])
def test_a_driver_that_holds_the_address(monkeypatch, tmp_path, driver, mark, says):
    """Advise the chip's other address beside a clock's driver, and to unbind a driver of the MPU."""
    device = tmp_path / "bus" / "i2c" / "devices" / "1-0068"
    device.mkdir(parents=True)
    (device / "driver").symlink_to(tmp_path / "bus" / "i2c" / "drivers" / driver)
    monkeypatch.setattr(host, "SYS", tmp_path)
    (tmp_path / "i2c-1").touch()
    monkeypatch.setattr(smbus2, "ioctl", Adapter().ioctl)
    finding = next(f for f in examine_host(str(tmp_path / "i2c-1")) if f.topic == "kernel driver")
    assert finding.mark is mark
    assert says in finding.remedy
    assert ("unbind" in finding.remedy) is (driver == "mpu")
