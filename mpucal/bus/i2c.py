"""A Linux I2C bus on smbus2. Knows no chip but the address where one answers, and repeats nothing.

Source: Linux Documentation/i2c/dev-interface.rst and fault-codes.rst.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..chip.access import Reply
from ..chip.registers import WHO_AM_I
from ..errors import BusError, NoAnswer
from .i2c_errors import nobody, opening_error, transfer_error

if TYPE_CHECKING:
    from smbus2 import i2c_msg

# AD0 low, AD0 high
ADDRESSES = (0x68, 0x69)

# i2c-dev refuses longer messages
MAX_MESSAGE_BYTES = 8192


class I2cBus:
    """The chip at one address of one adapter; the clock is the monotonic one of the host.

    Parameters
    ----------
    adapter : path or number of the adapter. address : where the chip is; None tries 0x68, then 0x69.

    Raises
    ------
    BusError : no such adapter, no permission, no adapter at all, or taken by a driver of the kernel.
    NoAnswer : nothing acknowledges the address.
    """

    def __init__(self, adapter: str | int, address: int | None = None) -> None:
        import smbus2  # noqa: PLC0415 - only where there is an I2C bus

        self._message = smbus2.i2c_msg
        self._path = f"/dev/i2c-{adapter}" if str(adapter).isdecimal() else str(adapter)
        self._smbus = smbus2.SMBus()
        try:
            with self._told(opening_error):
                self._smbus.open(self._path)
            if not self._smbus.funcs & smbus2.I2cFunc.I2C:
                raise BusError(f"the adapter {self._path} speaks SMBus only, not I2C", "use another adapter")
            self._address = self._find(ADDRESSES if address is None else (address,))
        except BaseException:
            self._smbus.close()
            raise

    @property
    def address(self) -> int:
        """Where the chip answers."""
        return self._address

    def read(self, register: int, count: int) -> Reply:
        """`count` bytes from `register` on, in one message; the time is the one just before the transfer."""
        if count > MAX_MESSAGE_BYTES:
            raise BusError(
                f"{self._path} moves at most {MAX_MESSAGE_BYTES} bytes at once, not {count}",
                "read less at once",
            )
        message = self._message.read(self._address, count)
        t_ns = self._transfer(self._message.write(self._address, [register]), message)
        return Reply(bytes(message), t_ns)

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time just before the transfer."""
        return self._transfer(self._message.write(self._address, [register, *data]))

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the monotonic clock shows `t_ns`."""
        time.sleep(max(0, t_ns - time.monotonic_ns()) * 1e-9)

    def close(self) -> None:
        """Let go of the adapter."""
        self._smbus.close()

    def _find(self, addresses: tuple[int, ...]) -> int:
        """The first address that answers.

        By a plain SMBus read: I2C_RDWR would not notice that a driver of the kernel holds the address.
        """
        failures: list[BusError] = []
        for address in addresses:
            try:
                with self._told(transfer_error, address):
                    self._smbus.read_byte_data(address, WHO_AM_I)
            except BusError as error:
                failures.append(error)
            else:
                return address
        for failure in failures:
            if not isinstance(failure, NoAnswer):
                raise failure
        raise nobody(self._path, addresses)

    def _transfer(self, *messages: i2c_msg) -> int:
        t_ns = time.monotonic_ns()
        with self._told(transfer_error, self._address):
            self._smbus.i2c_rdwr(*messages)
        return t_ns

    @contextmanager
    def _told(self, sentence: Callable[..., BusError], *where: int) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise sentence(error, self._path, *where) from error
