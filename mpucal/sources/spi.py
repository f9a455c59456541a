"""Chip on a Linux SPI bus, by spidev.

A message is one byte of address, with bit 7 set to read, then the data (PS-MPU-6000A r3.4, section 9.4: mode 3, 1 MHz
for all registers; the data registers and the FIFO are read at the part's highest clock). The chip's I2C interface must
be off: the bit I2C_IF_DIS is added to writes of USER_CTRL and removed from reads of it, so that the driver above and
its captures are those of I2C. An ICM-20602 and its like have this bit in their own register 112 (DS-000176).
"""

from __future__ import annotations

from collections.abc import Callable

from ..chip import registers as reg
from ..chip.access import Reply
from ..chip.families import PARTS
from ..errors import BusError, UsageError
from .chip import OpenedChip
from .host_bus import RegisterBus, converting, device_error, lock_device
from .kind import Request

READ = 0x80
REGISTER_HZ, LEAST_DATA_HZ = 1_000_000, 8_000_000
I2C_IF_DIS = 0x10
I2C_IF, I2C_IF_OFF = 0x70, 0x40
# Size of spidev's buffer, less the byte of the address.
MAX_DATA_BYTES = 4095
DATA = (*range(reg.ACCEL_XOUT_H, reg.ACCEL_XOUT_H + reg.FRAME_BYTES), reg.FIFO_R_W)


def open_source(request: Request) -> OpenedChip:
    """Open the chip on the device that --spi names; see SpiBus."""
    return OpenedChip(SpiBus(request.value), request.plan, words=request.words, own_process=True)


class SpiBus(RegisterBus):
    """Chip at one chip select.

    Parameters
    ----------
    path : /dev/spidevB.C, or with the highest clock for its wires: /dev/spidevB.C:HZ.

    Raises
    ------
    UsageError : an impossible clock.
    BusError : no such device, no permission, not an SPI device, in use by another process, or spidev is missing.
    """

    def __init__(self, path: str) -> None:
        super().__init__()
        try:
            import spidev  # noqa: PLC0415 - only needed with an SPI bus
        except ImportError:
            raise BusError("the Python library spidev is not installed", "pip install mpucal[spi]") from None
        self._path, _, hz = path.partition(":")
        if hz and not (hz.isdecimal() and int(hz) >= REGISTER_HZ):
            raise UsageError(f"{hz} is not a clock of an SPI bus", f"give {self._path}:HZ, with {REGISTER_HZ} or more")
        self._most_hz = float(hz or "inf")
        self._data_hz = int(min(LEAST_DATA_HZ, self._most_hz))
        self._device = spidev.SpiDev()
        with converting(self._error):
            self._device.open_path(self._path)
        try:
            lock_device(self._device.fileno(), f"the chip on {self._path}")
            with converting(self._error):
                self._device.mode = 3
                self._device.bits_per_word = 8
                self._device.max_speed_hz = self._data_hz
        except BusError:
            self._device.close()
            raise
        self._has_i2c_if = False

    def read(self, register: int, count: int) -> Reply:
        """Read registers; WHO_AM_I shows the chip's highest clock."""
        reply = super().read(register, count)
        part = PARTS.get(reply.data[0]) if register == reg.WHO_AM_I else None
        if part is not None:
            self._has_i2c_if = part.family.has_i2c_if
            self._data_hz = int(min(part.family.spi_data_hz, self._most_hz))
        return reply._replace(data=_change_user_ctrl(register, reply.data, lambda value: value & ~I2C_IF_DIS))

    def _read_part(self, register: int, count: int) -> bytes:
        hz = self._data_hz if register in DATA else REGISTER_HZ
        return self._transfer(bytes([READ | register]) + bytes(min(count, MAX_DATA_BYTES)), hz)[1:]

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time just before the transfer."""
        t_ns = self.now_ns()
        off = 0 if self._has_i2c_if else I2C_IF_DIS
        self._transfer(bytes([register]) + _change_user_ctrl(register, data, lambda value: value | off), REGISTER_HZ)
        reset = register == reg.PWR_MGMT_1 and data[0] & reg.PWR_MGMT_1_DEVICE_RESET
        if self._has_i2c_if and register == reg.PWR_MGMT_1 and not reset:
            self._transfer(bytes([I2C_IF, I2C_IF_OFF]), REGISTER_HZ)
        return t_ns

    def close(self) -> None:
        """Close the device."""
        self._device.close()

    def _transfer(self, message: bytes, hz: int) -> bytes:
        with converting(self._error):
            return bytes(self._device.xfer2(list(message), hz))

    def _error(self, error: OSError) -> BusError:
        there = "enable SPI (`dtparam=spi=on` on a Raspberry Pi), and give a /dev/spidevB.C that supports mode 3"
        return device_error(error, self._path, "an SPI device", "spi", there)


def _change_user_ctrl(register: int, data: bytes, change: Callable[[int], int]) -> bytes:
    """Return `data` from `register` on, with the byte of USER_CTRL changed if it is in it."""
    at = reg.USER_CTRL - register
    if register == reg.FIFO_R_W or not 0 <= at < len(data):
        return data
    return data[:at] + bytes([change(data[at])]) + data[at + 1 :]
