"""Fixtures: the kernel's side of an I2C adapter, which answers the ioctls of the real smbus2."""

import ctypes
import os
import sys
from dataclasses import dataclass, field
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from smbus2 import smbus2

import mpucal.sources.host_bus
from mpucal.simulated.chip import SimulatedBus
from mpucal.simulated.chip.bus import FastClock
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.chip.models import MODELS, FactoryTrim

SPEC = spec_from_file_location("kernels_adapter", Path(__file__).parents[1] / "device" / "harness" / "adapter.py")
harness = sys.modules["kernels_adapter"] = module_from_spec(SPEC)
SPEC.loader.exec_module(harness)


class StillFeed:
    """Samples of a board that lies flat at 30.65 C; the gyroscope's z alternates."""

    def __init__(self):
        self.next = 0

    def samples(self, edges_s, setting):
        n = len(edges_s) - 1
        one_g = round(32768 / setting.accel_range_g)
        rows = np.tile(np.array([12, -34, one_g, -2000, 56, -78, 90], np.int16), (n, 1))
        rows[:, 6] += np.arange(self.next, self.next + n) % 2
        self.next += n
        return rows


class Memory:
    """Part of this process's memory, as Memory of tests/device/harness/umockdev.py is of another's."""

    def __init__(self, address, size):
        self._address, self._size = address, size

    def at(self, offset, size):
        return Memory(ctypes.c_void_p.from_address(self._address + offset).value, size)

    def bytes(self):
        return ctypes.string_at(self._address, self._size)

    def write(self, data, offset=0):
        ctypes.memmove(self._address + offset, data, len(data))


@dataclass
class Adapter(harness.Adapter):
    """Adapter that answers the requests of smbus2 in this process.

    Attributes
    ----------
    failures : errno by ioctl request, raised instead. requests : those that were made.
    """

    failures: dict = field(default_factory=dict)
    requests: list = field(default_factory=list)

    def ioctl(self, fd, request, argument):
        os.fstat(fd)
        self.requests.append(request)
        value = argument if isinstance(argument, int) else 0
        pointer = ctypes.c_void_p(0 if isinstance(argument, int) else ctypes.addressof(argument))
        number = self.failures.get(request) or self.answer(Memory(ctypes.addressof(pointer), 8), request, value)
        if number:
            raise OSError(number, os.strerror(number))
        return 0


@pytest.fixture
def still_chip():
    """Makes the bus of a simulated chip at rest, and its clock, which runs only during waits."""

    def make(model="mpu6050", rate_error_ppm=2500.0):
        clock = FastClock()
        return SimulatedBus(Chip(MODELS[model], StillFeed(), rate_error_ppm, FactoryTrim()), clock), clock

    return make


@pytest.fixture
def host_time(monkeypatch):
    """Makes a clock, which runs only during waits, that of the host."""

    def make(clock):
        time = SimpleNamespace(monotonic_ns=clock.now, sleep=lambda s: clock.sleep_until(clock.now() + round(s * 1e9)))
        monkeypatch.setattr(mpucal.sources.host_bus, "time", time)
        # Time that only waiting takes waits for one process alone.
        monkeypatch.setattr("mpucal.sources.chip.CAN_FORK", False)

    return make


@pytest.fixture
def adapter(monkeypatch, tmp_path, still_chip, host_time):
    """Makes an adapter at a path that smbus2 can open; its clock becomes the host's."""

    def make(model="mpu6050", address=0x68):
        bus, clock = still_chip(model)
        kernel = Adapter(bus, address)
        kernel.path = tmp_path / "i2c-1"
        kernel.path.touch()
        monkeypatch.setattr(smbus2, "ioctl", kernel.ioctl)
        host_time(clock)
        return kernel

    return make
