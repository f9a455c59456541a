"""A chip on a Linux SPI bus, by spidev.

A message is one byte of address, with bit 7 set to read, then the data (PS-MPU-6000A r3.4, section 9.4: mode 3, 1 MHz
for all registers; the measured ones and the FIFO are read as fast as the part allows). While a chip is used so, its
I2C is to be off: the bit I2C_IF_DIS is added to what is written to USER_CTRL and taken from what is read there, so that
the driver above and its captures are those of I2C. An ICM-20602 and its like have the bit in register 112, which is its
own (DS-000176).
"""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..chip.access import Reply
from ..chip.families import PARTS, Part
from ..chip.registers import (
    ACCEL_XOUT_H,
    FIFO_R_W,
    FRAME_BYTES,
    PWR_MGMT_1,
    PWR_MGMT_1_DEVICE_RESET,
    USER_CTRL,
    WHO_AM_I,
)
from ..errors import BusError, UsageError
from .chip import OpenedChip
from .device_lock import lock_device
from .kind import Request
from .read_timer import ReadTimer

READ, MODE = 0x80, 3
REGISTER_HZ, LEAST_DATA_HZ = 1_000_000, 8_000_000
I2C_IF_DIS = 0x10
I2C_IF, I2C_IF_OFF = 0x70, 0x40
# spidev's buffer, less the address
LONGEST = 4095
DATA = (*range(ACCEL_XOUT_H, ACCEL_XOUT_H + FRAME_BYTES), FIFO_R_W)


def open_source(request: Request) -> OpenedChip:
    """The chip on the device that --spi names; see SpiBus."""
    return OpenedChip(SpiBus(request.value), request.plan, words=request.words)


class SpiBus:
    """The chip at one chip select; the clock is the monotonic one of the host.

    Parameters
    ----------
    path : /dev/spidevB.C, or with the fastest clock that its wires bear: /dev/spidevB.C:HZ.

    Raises
    ------
    UsageError : a clock that is none.
    BusError : no such device, no permission, no SPI device at all, another process's, or the library is missing.
    """

    def __init__(self, path: str) -> None:
        try:
            import spidev  # noqa: PLC0415 - only where there is an SPI bus
        except ImportError:
            raise BusError("the Python library spidev is not installed", "pip install mpucal[spi]") from None
        self._path, _, hz = path.partition(":")
        if hz and not (hz.isdecimal() and int(hz) >= REGISTER_HZ):
            raise UsageError(f"{hz} is no clock for an SPI bus", f"give {self._path}:HZ, of {REGISTER_HZ} or more")
        self._most_hz = float(hz or "inf")
        self._data_hz = int(min(LEAST_DATA_HZ, self._most_hz))
        self._device = spidev.SpiDev()
        with self._told():
            self._device.open_path(self._path)
        try:
            lock_device(self._device.fileno(), f"the chip on {self._path}")
            with self._told():
                self._device.mode = MODE
                self._device.bits_per_word = 8
                self._device.max_speed_hz = self._data_hz
        except BusError:
            self._device.close()
            raise
        self._own_register = False
        self._stamp = ReadTimer(time.monotonic_ns)

    def read(self, register: int, count: int) -> Reply:
        """`count` bytes from `register` on, in messages of up to 4095 bytes; the time is the one just before."""
        reply = self._stamp.read(register, count, lambda: self._read(register, count))
        if register == WHO_AM_I:
            self._knows(PARTS.get(reply.data[0]))
        return reply._replace(data=_altered(register, reply.data, lambda held: held & ~I2C_IF_DIS))

    def _read(self, register: int, count: int) -> bytes:
        data = b""
        hz = self._data_hz if register in DATA else REGISTER_HZ
        while len(data) < count:
            place = register if register == FIFO_R_W else register + len(data)
            part = min(count - len(data), LONGEST)
            data += self._moved(bytes([READ | place]) + bytes(part), hz)[1:]
        return data

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time just before the transfer."""
        t_ns = time.monotonic_ns()
        off = 0 if self._own_register else I2C_IF_DIS
        self._moved(bytes([register]) + _altered(register, data, lambda value: value | off), REGISTER_HZ)
        reset = register == PWR_MGMT_1 and data[0] & PWR_MGMT_1_DEVICE_RESET
        if self._own_register and register == PWR_MGMT_1 and not reset:
            self._moved(bytes([I2C_IF, I2C_IF_OFF]), REGISTER_HZ)
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the monotonic clock shows `t_ns`."""
        time.sleep(max(0, t_ns - time.monotonic_ns()) * 1e-9)

    def close(self) -> None:
        """Let go of the device."""
        self._device.close()

    def _knows(self, part: Part | None) -> None:
        """What chip answers, where it is one of the table."""
        if part is not None:
            self._own_register = part.family.fifo_en_with_temperature
            self._data_hz = int(min(part.family.spi_data_hz, self._most_hz))

    def _moved(self, message: bytes, hz: int) -> bytes:
        with self._told():
            return bytes(self._device.xfer2(list(message), hz))

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise _sentence(error, self._path) from error


def _altered(register: int, data: bytes, change: Callable[[int], int]) -> bytes:
    """`data` from `register` on, with what is USER_CTRL's changed."""
    at = USER_CTRL - register
    if register == FIFO_R_W or not 0 <= at < len(data):
        return data
    return data[:at] + bytes([change(data[at])]) + data[at + 1 :]


def _sentence(error: OSError, path: str) -> BusError:
    """Why the device at `path` cannot be used."""
    if error.errno == errno.ENOENT:
        return BusError(
            f"there is no SPI device {path}",
            "enable SPI (`dtparam=spi=on` on a Raspberry Pi), and give /dev/spidevB.C",
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        remedy = "join the group that may: `sudo usermod -aG spi $USER`, then log in again"
        return BusError(f"no permission to use {path}", remedy)
    if error.errno in (errno.ENOTTY, errno.EISDIR, errno.EINVAL):
        return BusError(f"{path} is no SPI device, or does not take mode 3", "give /dev/spidevB.C")
    if error.errno in (errno.ENODEV, errno.ENXIO, errno.ESHUTDOWN):
        return BusError(f"the SPI device {path} is gone", "check its driver, and start again")
    return BusError(f"a transfer with {path} failed ({error.strerror})", "check the wires, and start again")
