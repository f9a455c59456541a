"""Who is on a bus, asked as i2cdetect asks: of an adapter whose ioctls are answered in this process."""

import errno
import os

import pytest
from smbus2 import smbus2

from mpucal.doctor.finding import Mark
from mpucal.doctor.host import examine_host


class Adapter:
    """0x68 answers and nobody else; `fails` says the errno of a transfer with an address, 0 for none."""

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
    """What is said of who is on the bus of an adapter."""
    (tmp_path / "i2c-1").touch()

    def tell(adapter):
        monkeypatch.setattr(smbus2, "ioctl", adapter.ioctl)
        findings = list(examine_host(str(tmp_path / "i2c-1")))
        return next(finding for finding in findings if finding.topic == "on the bus")

    return tell


def test_every_address_is_asked(told):
    adapter = Adapter()
    assert told(adapter).data["addresses"] == [0x68]
    assert sorted(set(adapter.asked)) == list(range(0x08, 0x78))


def test_a_bus_that_is_held_is_not_asked_for_every_address(told):
    adapter = Adapter(lambda _address: errno.ETIMEDOUT)
    finding = told(adapter)
    assert finding.mark is Mark.BAD
    assert "does not come free" in finding.what
    assert "holds SDA or SCL low" in finding.remedy
    assert len(adapter.asked) < 5


def test_one_slow_device_does_not_hide_the_others(told):
    adapter = Adapter(lambda address: errno.ETIMEDOUT if address in (0x20, 0x21, 0x40) else 0)
    assert told(adapter).data["addresses"] == [0x68]
