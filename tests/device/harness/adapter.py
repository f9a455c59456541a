"""Ioctls of a Linux I2C adapter, answered as the kernel does. It knows no chip: a bus is behind it.

Source: Linux include/uapi/linux/i2c-dev.h and i2c.h, drivers/i2c/i2c-dev.c; for a Raspberry Pi's limit
drivers/i2c/busses/i2c-bcm2835.c.
"""

from __future__ import annotations

import errno
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from mpucal.errors import BusError, NoAnswer

if TYPE_CHECKING:
    from umockdev import Memory

I2C_RETRIES, I2C_TIMEOUT, I2C_SLAVE, I2C_TENBIT, I2C_FUNCS = 0x0701, 0x0702, 0x0703, 0x0704, 0x0705
I2C_SLAVE_FORCE, I2C_RDWR, I2C_PEC, I2C_SMBUS = 0x0706, 0x0707, 0x0708, 0x0720

FUNC_I2C, FUNC_SMBUS = 0x00000001, 0x0EFF0008
RDWR, MESSAGE, SMBUS = struct.Struct("<QI4x"), struct.Struct("<HHH2xQ"), struct.Struct("<BBxxIQ")
M_RD, MAX_MESSAGES, MAX_BYTES = 0x0001, 42, 8192

QUICK, BYTE, BYTE_DATA, WORD_DATA, I2C_BLOCK_DATA = 0, 1, 2, 3, 8
UNION_BYTES, BLOCK_BYTES = 34, 32

# errno of a bus's error that does not name one itself
NOBODY, BROKEN = errno.EREMOTEIO, errno.EIO


@dataclass
class Adapter:
    """Adapter with a chip.

    Attributes
    ----------
    bus : of the chip. address : of the chip. functions : that the adapter reports.
    bound : addresses that a driver of the kernel holds. pi : one read message at most, and that last.
    longest : message that it transfers [bytes]. repeats_start : it transfers two messages at once.
    fails : errno of every transfer from now on, 0: none. transfers : (flags, bytes) of each message of the last ones.
    """

    bus: Any
    address: int = 0x68
    functions: int = FUNC_I2C | FUNC_SMBUS
    bound: frozenset[int] = frozenset()
    pi: bool = True
    longest: int = MAX_BYTES
    repeats_start: bool = True
    fails: int = 0
    transfers: list[list[tuple[int, int]]] = field(default_factory=list)
    _chosen: int = -1
    _register: int = 0

    def answer(self, memory: Memory, request: int, value: int) -> int:
        """Answer an ioctl: 0, or an errno."""
        if request == I2C_FUNCS:
            _there(memory, 8).write(self.functions.to_bytes(8, "little"))
            return 0
        if request in (I2C_SLAVE, I2C_SLAVE_FORCE):
            return self._choose(value, force=request == I2C_SLAVE_FORCE)
        if request == I2C_SMBUS:
            return self._tried(self._smbus, _there(memory, SMBUS.size))
        if request == I2C_RDWR:
            return self._tried(self._rdwr, _there(memory, RDWR.size))
        return 0 if request in (I2C_RETRIES, I2C_TIMEOUT, I2C_TENBIT, I2C_PEC) else errno.ENOTTY

    def is_there(self, address: int) -> bool:
        """Return True if a chip acknowledges this address."""
        return address == self.address

    def _choose(self, address: int, force: bool) -> int:
        if address > 0x7F:
            return errno.EINVAL
        if address in self.bound and not force:
            return errno.EBUSY
        self._chosen = address
        return 0

    def _tried(self, transfer: Any, argument: Memory) -> int:
        if self.fails:
            return self.fails
        try:
            return transfer(argument)
        except NoAnswer as error:
            return _errno(error, NOBODY)
        except BusError as error:
            return _errno(error, BROKEN)

    def _smbus(self, argument: Memory) -> int:
        reads, command, size, _ = SMBUS.unpack(argument.bytes())
        if not self.is_there(self._chosen):
            return NOBODY
        if size == QUICK:
            return 0
        if size == BYTE and not reads:
            self._register = command
            self.bus.write(command, b"")
            return 0
        if reads and size != BYTE and not self.repeats_start:
            return errno.EOPNOTSUPP
        data = argument.at(8, UNION_BYTES)
        if data is None or size not in (BYTE, BYTE_DATA, WORD_DATA, I2C_BLOCK_DATA):
            return errno.EOPNOTSUPP
        block = size == I2C_BLOCK_DATA
        count = {BYTE: 1, BYTE_DATA: 1, WORD_DATA: 2}.get(size) or data.bytes()[0]
        if not 0 < count <= BLOCK_BYTES:
            return errno.EINVAL
        self.transfers.append([(reads, count)])
        if reads:
            data.write(self.bus.read(self._register if size == BYTE else command, count).data, offset=int(block))
        else:
            self.bus.write(command, data.bytes()[int(block) :][:count])
        return 0

    def _rdwr(self, argument: Memory) -> int:
        _, count = RDWR.unpack(argument.bytes())
        if not self.functions & FUNC_I2C:
            return errno.EOPNOTSUPP
        if count > MAX_MESSAGES:
            return errno.EINVAL
        table = _there(argument, MESSAGE.size * count)
        messages = [MESSAGE.unpack_from(table.bytes(), MESSAGE.size * i) for i in range(count)]
        if any(length > MAX_BYTES for _, _, length, _ in messages):
            return errno.EINVAL
        if self.pi and any(flags & M_RD for _, flags, _, _ in messages[:-1]):
            return errno.EOPNOTSUPP
        if (count > 1 and not self.repeats_start) or any(length > self.longest for _, _, length, _ in messages):
            return errno.EOPNOTSUPP
        if not all(self.is_there(address) for address, _, _, _ in messages):
            return NOBODY
        self.transfers.append([(flags, length) for _, flags, length, _ in messages])
        for i, (_, flags, length, _) in enumerate(messages):
            data = table.at(MESSAGE.size * i + 8, length)
            if data is None:
                return errno.EFAULT
            if flags & M_RD:
                data.write(self.bus.read(self._register, length).data)
            else:
                self._register, *values = data.bytes()
                if values:
                    self.bus.write(self._register, bytes(values))
        return 0


def _there(memory: Memory, size: int) -> Memory:
    pointed = memory.at(0, size)
    if pointed is None:
        raise ValueError("an ioctl without its argument")
    return pointed


def _errno(error: BusError, otherwise: int) -> int:
    """Return the error number of the bus error's cause."""
    cause = error.__cause__
    return (cause.errno or otherwise) if isinstance(cause, OSError) else otherwise
