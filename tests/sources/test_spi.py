"""Chip behind the interface of spidev: mode, speeds, messages, and the driver."""

import builtins
import errno
import os
import sys
from types import ModuleType

import numpy as np
import pytest

from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.errors import BusError, UsageError
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.bus import FastClock
from mpucal.sources.spi import SpiBus


class SpiDev:
    """The used part of spidev 3.8, with a simulated chip behind it."""

    chip, opens, mode, bits_per_word, max_speed_hz = None, None, 0, 8, 500_000

    def __init__(self):
        self.messages, self.closed = [], False
        type(self).made = self

    def open_path(self, path):
        if self.opens:
            raise OSError(self.opens, os.strerror(self.opens))
        self.path = path

    def fileno(self):
        return None

    def xfer2(self, values, speed_hz=0, delay_usecs=0, bits_per_word=0):
        assert isinstance(values, list)
        assert len(values) <= 4096
        self.messages.append((bytes(values), speed_hz or self.max_speed_hz))
        address, count = values[0] & 0x7F, len(values) - 1
        if values[0] & 0x80:
            return [0, *self.chip.read(address, count).data]
        self.chip.write(address, bytes(values[1:]))
        return [0] * len(values)

    def close(self):
        self.closed = True


@pytest.fixture
def opened(monkeypatch, host_time):
    """Makes a bus to a simulated chip, and returns it with the device that it opened."""

    def make(words="chip=mpu6500,hand=still"):
        clock = FastClock()
        chip = open_simulated(f"sim:seed=4,{words}", clock=clock)
        chip.hear(Prompt(PromptKind.LAY_FLAT, ""))
        library = ModuleType("spidev")
        library.SpiDev = type("SpiDev", (SpiDev,), {"chip": chip})
        monkeypatch.setitem(sys.modules, "spidev", library)
        host_time(clock)
        bus = SpiBus("/dev/spidev0.0")
        return bus, library.SpiDev.made

    return make


@pytest.mark.parametrize(
    ("chip", "who_am_i", "data_hz"), [("mpu6500", b"\x70", 20_000_000), ("clone98", b"\x98", 8_000_000)]
)
def test_messages_have_the_mode_and_speed_of_the_data_sheet(opened, chip, who_am_i, data_hz):
    bus, device = opened(f"chip={chip},hand=still")
    assert (device.path, device.mode, device.bits_per_word) == ("/dev/spidev0.0", 3, 8)
    assert bus.read(reg.WHO_AM_I, 1).data == who_am_i
    bus.write(reg.SMPLRT_DIV, b"\x04\x03")
    bus.read(reg.ACCEL_XOUT_H, 14)
    bus.read(reg.FIFO_R_W, 28)
    assert device.messages == [
        (b"\xf5\x00", 1_000_000),
        (b"\x19\x04\x03", 1_000_000),
        (b"\xbb" + bytes(14), data_hz),
        (b"\xf4" + bytes(28), data_hz),
    ]
    bus.close()
    assert device.closed


def test_a_given_clock_is_not_exceeded(opened):
    opened()
    bus = SpiBus("/dev/spidev0.0:4000000")
    bus.read(reg.WHO_AM_I, 1)
    bus.read(reg.FIFO_R_W, 28)
    assert bus._device.path == "/dev/spidev0.0"
    assert [hz for _, hz in bus._device.messages] == [1_000_000, 4_000_000]
    with pytest.raises(UsageError, match=r"quick is not a clock .*give /dev/spidev0\.0:HZ"):
        SpiBus("/dev/spidev0.0:quick")


@pytest.mark.parametrize("chip", ["mpu6500", "icm20602"])
def test_the_driver_measures_and_i2c_stays_off(opened, chip):
    """Every write to USER_CTRL turns I2C off; the driver reads back what it wrote."""
    bus, device = opened(f"chip={chip},hand=still,temperature_c=30")
    driver = Driver(bus, Config(rate_hz=1000))
    driver.start()
    while driver.now_ns() < 2e9:
        driver.poll()
    recording = driver.recording()
    driver.stop()
    assert not recording.gap.any()
    assert np.linalg.norm(recording.acc, axis=1).mean() == pytest.approx(9.8, abs=1)
    assert recording.temperature_c.mean() == pytest.approx(30, abs=0.2)
    controls = [message[1] for message, _ in device.messages if message[0] == reg.USER_CTRL]
    own = [message for message, _ in device.messages if message[0] == 0x70]
    assert controls
    if chip == "icm20602":
        assert set(own) == {b"\x70\x40"}
        assert not any(value & 0x10 for value in controls)
    else:
        assert own == []
        assert all(value & 0x10 for value in controls)


@pytest.mark.parametrize(
    ("number", "says"),
    [
        (errno.ENOENT, "there is no SPI device /dev/spidev0.0: enable SPI"),
        (errno.EACCES, "no permission to use /dev/spidev0.0: add yourself"),
        (errno.EIO, "/dev/spidev0.0 does not work"),
    ],
)
def test_each_reason_that_a_device_cannot_be_opened_is_reported(opened, monkeypatch, number, says):
    _, device = opened()
    monkeypatch.setattr(type(device), "opens", number)
    with pytest.raises(BusError, match=says):
        SpiBus("/dev/spidev0.0")


def test_a_missing_library_is_reported_with_its_install_command(monkeypatch):
    usual = builtins.__import__

    def without(name, *rest):
        if name == "spidev":
            raise ImportError(name)
        return usual(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(BusError, match=r"pip install mpucal\[spi\]"):
        SpiBus("/dev/spidev0.0")
