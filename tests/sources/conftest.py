"""Fixtures: the kernel's side of an I2C adapter, which answers the ioctls of the real smbus2."""

import ctypes
import errno
import os
from types import SimpleNamespace

import numpy as np
import pytest
from smbus2 import smbus2

import mpucal.sources.host_bus
from mpucal.simulated.chip import SimulatedBus
from mpucal.simulated.chip.bus import FastClock
from mpucal.simulated.chip.chip import Chip
from mpucal.simulated.chip.models import MODELS, FactoryTrim

I2C_M_RD = 0x0001


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


class Adapter:
    """Adapter that passes the requests of smbus2 to `bus`, if they are for `address`.

    Attributes
    ----------
    longest : message that it moves, in bytes. repeats_start : moves two messages in one transfer.
    failures : errno by ioctl request, raised instead.
    transfers : [(flags, bytes)] of each I2C_RDWR.
    """

    def __init__(self, bus, address=0x68):
        self.bus, self.address = bus, address
        self.functions = int(smbus2.I2cFunc.I2C | smbus2.I2cFunc.SMBUS_EMUL)
        self.longest, self.repeats_start = 8192, True
        self.failures, self.transfers, self.requests = {}, [], []
        self._chosen = self._register = None

    def ioctl(self, fd, request, argument):
        os.fstat(fd)
        self.requests.append(request)
        if request in self.failures:
            raise _os_error(self.failures[request])
        answer = {
            smbus2.I2C_FUNCS: self._functions,
            smbus2.I2C_SLAVE: self._choose,
            smbus2.I2C_SMBUS: self._smbus,
            smbus2.I2C_RDWR: self._rdwr,
        }[request]
        answer(argument)
        return 0

    def _functions(self, argument):
        assert isinstance(argument, ctypes.c_ulong)
        argument.value = self.functions

    def _choose(self, address):
        self._chosen = address

    def _smbus(self, argument):
        self._acknowledge(self._chosen)
        if argument.size == smbus2.I2C_SMBUS_BYTE:
            if argument.read_write == smbus2.I2C_SMBUS_WRITE:
                self._register = argument.command
            else:
                argument.data.contents.byte = self.bus.read(self._register, 1).data[0]
            return
        block = argument.data.contents.block
        if argument.size == smbus2.I2C_SMBUS_BYTE_DATA:
            assert argument.read_write == smbus2.I2C_SMBUS_READ
            if not self.repeats_start:
                raise _os_error(errno.EOPNOTSUPP)
            argument.data.contents.byte = self.bus.read(argument.command, 1).data[0]
            return
        assert argument.size == smbus2.I2C_SMBUS_I2C_BLOCK_DATA
        self.transfers.append([(argument.read_write, block[0])])
        if argument.read_write == smbus2.I2C_SMBUS_WRITE:
            self.bus.write(argument.command, bytes(block[1 : 1 + block[0]]))
        else:
            block[1 : 1 + block[0]] = list(self.bus.read(argument.command, block[0]).data)

    def _rdwr(self, argument):
        messages = [argument.msgs[i] for i in range(argument.nmsgs)]
        if len(messages) > 1 and not self.repeats_start:
            raise _os_error(errno.EOPNOTSUPP)
        for message in messages:
            self._acknowledge(message.addr)
            if message.len > 8192:
                raise _os_error(errno.EINVAL)
            if message.len > self.longest:
                raise _os_error(errno.EOPNOTSUPP)
        self.transfers.append([(m.flags, m.len) for m in messages])
        if any(m.flags & I2C_M_RD for m in messages[:-1]):
            raise _os_error(errno.EOPNOTSUPP)
        for message in messages:
            if message.flags & I2C_M_RD:
                ctypes.memmove(message.buf, self.bus.read(self._register, message.len).data, message.len)
                continue
            self._register, *data = bytes(message)
            if data:
                self.bus.write(self._register, bytes(data))

    def _acknowledge(self, address):
        if address != self.address:
            raise _os_error(errno.EREMOTEIO)


def _os_error(number):
    return OSError(number, os.strerror(number))


@pytest.fixture
def still_chip():
    """Makes the bus of a simulated chip at rest, and its clock, which runs only during waits."""

    def make(model="mpu6050", rate_error_ppm=2500.0):
        clock = FastClock()
        return SimulatedBus(Chip(MODELS[model], StillFeed(), rate_error_ppm, FactoryTrim()), clock), clock

    return make


@pytest.fixture
def adapter(monkeypatch, tmp_path, still_chip):
    """Makes an adapter at a path that smbus2 can open; its clock becomes the host's."""

    def make(model="mpu6050", address=0x68):
        bus, clock = still_chip(model)
        kernel = Adapter(bus, address)
        kernel.path = tmp_path / "i2c-1"
        kernel.path.touch()
        monkeypatch.setattr(smbus2, "ioctl", kernel.ioctl)
        time = SimpleNamespace(monotonic_ns=clock.now, sleep=lambda s: clock.sleep_until(clock.now() + round(s * 1e9)))
        monkeypatch.setattr(mpucal.sources.host_bus, "time", time)
        # Time that only waiting takes waits for one process alone.
        monkeypatch.setattr("mpucal.sources.chip.CAN_FORK", False)
        return kernel

    return make
