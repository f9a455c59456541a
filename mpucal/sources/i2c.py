"""A chip on a Linux I2C bus, by smbus2.

What an adapter can do is found, not assumed: plain I2C where there is any, else SMBus blocks of 32 bytes; and where
it refuses a transfer before anything has moved, as one without a repeated start or of shorter messages.

Source: Linux Documentation/i2c/dev-interface.rst and fault-codes.rst; drivers/i2c/i2c-core-base.c for what it refuses.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..chip.access import Reply
from ..chip.families import PARTS
from ..chip.registers import FIFO_R_W, WHO_AM_I
from ..errors import BusError, NoAnswer
from .chip import OpenedChip
from .device_lock import lock_device
from .i2c_errors import no_answer_error, opening_error, transfer_error
from .kind import Request
from .read_timer import ReadTimer

# AD0 low, AD0 high
ADDRESSES = (0x68, 0x69)

TRIES = 3

# i2c-dev refuses longer messages
MAX_MESSAGE_BYTES = 8192
SMBUS_BLOCK_BYTES = 32
# an adapter that refuses even this little cannot do what is asked of it at all
SHORTEST_LIMIT = 4


def open_source(request: Request) -> OpenedChip:
    """The chip on the bus that --bus names; see I2cBus."""
    return OpenedChip(I2cBus(request.value, request.values.get("address")), request.plan, words=request.words)


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
        self._stamp = ReadTimer(time.monotonic_ns)
        self._smbus = smbus2.SMBus()
        try:
            with self._told(opening_error):
                self._smbus.open(self._path)
            self._blocks = not self._smbus.funcs & smbus2.I2cFunc.I2C
            if self._blocks and not self._smbus.funcs & smbus2.I2cFunc.SMBUS_READ_I2C_BLOCK:
                raise BusError(f"the adapter {self._path} moves single bytes only", "use another adapter")
            self._longest = SMBUS_BLOCK_BYTES if self._blocks else MAX_MESSAGE_BYTES
            self._repeated_start = True
            self._address = self._find(ADDRESSES if address is None else (address,))
            chip = f"the chip at 0x{self._address:02x} on {self._path}"
            lock_device(self._smbus.fd, chip, "end it, or take the other chip with --address", self._address)
        except BaseException:
            self._smbus.close()
            raise

    @property
    def address(self) -> int:
        """Where the chip answers."""
        return self._address

    def read(self, register: int, count: int) -> Reply:
        """`count` bytes from `register` on, in one message if the adapter can; the time is the one just before."""
        if count > MAX_MESSAGE_BYTES:
            raise BusError(
                f"{self._path} moves at most {MAX_MESSAGE_BYTES} bytes at once, not {count}",
                "read less at once",
            )
        return self._stamp.read(register, count, lambda: self._read(register, count))

    def _read(self, register: int, count: int) -> bytes:
        data = b""
        with self._told(transfer_error, self._address):
            while len(data) < count:
                # FIFO_R_W gives the next bytes again and again, any other register is followed by the next
                place = register if register == FIFO_R_W else register + len(data)
                try:
                    data += self._part(place, count - len(data))
                except OSError as error:
                    # what came before is gone: no transfer that nobody acknowledged
                    raise (OSError(errno.EIO, os.strerror(errno.EIO)) if data else error) from error
        return data

    def write(self, register: int, data: bytes) -> int:
        """Write `data` from `register` on, and return the time just before the transfer."""
        t_ns = time.monotonic_ns()
        with self._told(transfer_error, self._address):
            if self._blocks:
                self._smbus.write_i2c_block_data(self._address, register, list(data))
            else:
                self._smbus.i2c_rdwr(self._message.write(self._address, [register, *data]))
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the monotonic clock shows `t_ns`."""
        time.sleep(max(0, t_ns - time.monotonic_ns()) * 1e-9)

    def close(self) -> None:
        """Let go of the adapter."""
        self._smbus.close()

    def _find(self, addresses: tuple[int, ...]) -> int:
        """The first address at which a known part answers, else the first that answers at all.

        By a plain SMBus read: I2C_RDWR would not notice that a driver of the kernel holds the address.
        """
        failures: list[BusError] = []
        strangers: list[int] = []
        for address in addresses:
            try:
                answer = self._asked(address)
            except BusError as error:
                failures.append(error)
            else:
                if answer in PARTS:
                    return address
                strangers.append(address)
        if strangers:
            return strangers[0]
        for failure in failures:
            if not isinstance(failure, NoAnswer):
                raise failure
        raise no_answer_error(self._path, addresses)

    def _asked(self, address: int) -> int:
        """What answers there; one that is not acknowledged is asked again, since one in a hundred may be lost."""
        for _ in range(TRIES - 1):
            with suppress(NoAnswer), self._told(transfer_error, address):
                return self._identity(address)
        with self._told(transfer_error, address):
            return self._identity(address)

    def _identity(self, address: int) -> int:
        """What answers there; smbus2 asks for the address itself, which a driver of the kernel may hold."""
        try:
            return int(self._smbus.read_byte_data(address, WHO_AM_I))
        except OSError as error:
            # i2c-stub has no other number for an address where nothing is
            if error.errno == errno.ENODEV and Path(self._path).exists():
                raise no_answer_error(self._path, (address,)) from error
            if error.errno != errno.EOPNOTSUPP:
                raise
        # made of two messages, where the adapter moves one at a time
        self._smbus.write_byte(address, WHO_AM_I)
        return int(self._smbus.read_byte(address))

    def _part(self, register: int, count: int) -> bytes:
        """Up to `count` bytes, as many as go into one message."""
        count = min(count, self._longest)
        if self._blocks:
            return bytes(self._smbus.read_i2c_block_data(self._address, register, count))
        choose, message = self._message.write(self._address, [register]), self._message.read(self._address, count)
        try:
            if self._repeated_start:
                self._smbus.i2c_rdwr(choose, message)
            else:
                self._smbus.i2c_rdwr(choose)
                self._smbus.i2c_rdwr(message)
        except OSError as error:
            if error.errno != errno.EOPNOTSUPP:
                raise
            # refused before anything has moved (the kernel's i2c_check_for_quirks)
            if count > SHORTEST_LIMIT:
                self._longest = count // 2
            elif self._repeated_start:
                self._repeated_start, self._longest = False, MAX_MESSAGE_BYTES
            else:
                raise
            return self._part(register, count)
        return bytes(message)

    @contextmanager
    def _told(self, sentence: Callable[..., BusError], *where: int) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise sentence(error, self._path, *where) from error
