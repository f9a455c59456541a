"""Chip on a Linux I2C bus, by smbus2.

The adapter's abilities are tested: plain I2C if it has it, else SMBus blocks of 32 bytes. Some adapters refuse a
transfer before anything is sent: then shorter messages are tried, and messages without a repeated start.

Source: Linux Documentation/i2c/dev-interface.rst and fault-codes.rst; drivers/i2c/i2c-core-base.c for the refusals.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from ..chip.families import PARTS
from ..chip.registers import ADDRESSES, WHO_AM_I
from ..errors import BusError
from .chip import OpenedChip
from .host_bus import (
    DEVICES,
    RegisterBus,
    converting,
    device_error,
    find_chip,
    lock_device,
    no_answer_error,
    other_buses,
    transfer_error,
)
from .kind import Request

# Longest message of i2c-dev.
MAX_MESSAGE_BYTES = 8192


def open_source(request: Request) -> OpenedChip:
    """Open the chip on the bus that --bus names; see I2cBus."""
    return OpenedChip(
        I2cBus(request.value, request.values.get("address")), request.plan, words=request.words, own_process=True
    )


def found_chips(folder: Path = DEVICES) -> Iterator[tuple[str, str]]:
    """Yield the path of each adapter in `folder` on which a known chip answers, and the chip with its address.

    Nothing is written to a bus that was not named. One without permission is yielded as well, the others are not.
    """
    for path in sorted(folder.glob("i2c-*")):
        # A wire that is held low, or an adapter without a driver, is the matter of `mpucal doctor`.
        with suppress(OSError):
            if not os.access(path, os.R_OK | os.W_OK):
                yield str(path), "an I2C bus, not permitted to you so far"
            elif answer := _known_chip(path):
                yield str(path), answer


def _known_chip(path: Path) -> str:
    """Return the chip that answers on an adapter, with its address; empty if none does."""
    import smbus2  # noqa: PLC0415 - only needed with an I2C bus

    with smbus2.SMBus(str(path)) as bus:
        for address in ADDRESSES:
            try:
                part = PARTS.get(bus.read_byte_data(address, WHO_AM_I))
            except OSError as error:
                if error.errno == errno.ETIMEDOUT:
                    raise
                continue
            if part is not None:
                return f"{part.chip} at 0x{address:02x}"
    return ""


class I2cBus(RegisterBus):
    """Chip at one address of an adapter.

    Parameters
    ----------
    path : of the adapter. address : of the chip; None tries 0x68, then 0x69.

    Raises
    ------
    BusError : no such adapter, no permission, not an adapter, or the chip is held by a driver of the kernel.
    NoAnswer : nothing acknowledges the address.
    """

    def __init__(self, path: str, address: int | None = None) -> None:
        import smbus2  # noqa: PLC0415 - only needed with an I2C bus

        super().__init__()
        self._message = smbus2.i2c_msg
        self._path = path
        self._smbus = smbus2.SMBus()
        try:
            with converting(lambda error: device_error(error, path, "an I2C bus", "i2c", other_buses())):
                self._smbus.open(self._path)
            self._blocks = not self._smbus.funcs & smbus2.I2cFunc.I2C
            if self._blocks and not self._smbus.funcs & smbus2.I2cFunc.SMBUS_READ_I2C_BLOCK:
                raise BusError(f"the adapter {self._path} transfers single bytes only", "use another adapter")
            self._longest = smbus2.smbus2.I2C_SMBUS_BLOCK_MAX if self._blocks else MAX_MESSAGE_BYTES
            self._repeated_start = True
            self.address = find_chip(self._path, address, self._who_am_i)
            chip = f"the chip at 0x{self.address:02x} on {self._path}"
            lock_device(self._smbus.fd, chip, "end it, or use the other chip with --address", self.address)
        except BaseException:
            self._smbus.close()
            raise

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time just before the transfer."""
        t_ns = self.now_ns()
        with converting(lambda error: transfer_error(error, self._path, self.address)):
            if self._blocks:
                self._smbus.write_i2c_block_data(self.address, register, list(data))
            else:
                self._smbus.i2c_rdwr(self._message.write(self.address, [register, *data]))
        return t_ns

    def close(self) -> None:
        """Close the adapter."""
        self._smbus.close()

    def _who_am_i(self, address: int) -> int:
        """Read WHO_AM_I by SMBus, since I2C_RDWR does not notice that a driver of the kernel holds the address."""
        with converting(lambda error: transfer_error(error, self._path, address)):
            try:
                return int(self._smbus.read_byte_data(address, WHO_AM_I))
            except OSError as error:
                # i2c-stub has no other number for an empty address.
                if error.errno == errno.ENODEV and Path(self._path).exists():
                    raise no_answer_error(self._path, (address,)) from error
                if error.errno != errno.EOPNOTSUPP:
                    raise
            # Some adapters transfer only one message at a time.
            self._smbus.write_byte(address, WHO_AM_I)
            return int(self._smbus.read_byte(address))

    def _read_part(self, register: int, count: int) -> bytes:
        with converting(lambda error: transfer_error(error, self._path, self.address)):
            return self._transfer(register, min(count, self._longest))

    def _transfer(self, register: int, count: int) -> bytes:
        """Read `count` bytes, or fewer if the adapter refuses so many."""
        if self._blocks:
            return bytes(self._smbus.read_i2c_block_data(self.address, register, count))
        choose, message = self._message.write(self.address, [register]), self._message.read(self.address, count)
        try:
            if self._repeated_start:
                self._smbus.i2c_rdwr(choose, message)
            else:
                self._smbus.i2c_rdwr(choose)
                self._smbus.i2c_rdwr(message)
        except OSError as error:
            if error.errno != errno.EOPNOTSUPP:
                raise
            # The kernel refused it before anything was sent (i2c_check_for_quirks). An adapter that refuses even four
            # bytes does not support the kind of transfer.
            if count > 4:
                self._longest = count // 2
            elif self._repeated_start:
                self._repeated_start, self._longest = False, MAX_MESSAGE_BYTES
            else:
                raise
            return self._transfer(register, min(count, self._longest))
        return bytes(message)
