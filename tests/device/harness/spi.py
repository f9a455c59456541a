"""Ioctls of Linux's spidev, answered as the kernel does. It knows no chip: a bus is behind it.

Source: Linux include/uapi/linux/spi/spidev.h and spi.h, drivers/spi/spidev.c.
"""

import errno
import struct
from dataclasses import dataclass, field
from typing import Any

from umockdev import Memory

# 'k' << 8 | number, with the size of the argument and the direction above: _IOC of asm-generic/ioctl.h
TYPE, MESSAGE, MODE, LSB_FIRST, BITS, SPEED, MODE32 = 0x6B, 0, 1, 2, 3, 4, 5
WRITES = 1
# tx_buf, rx_buf, len, speed_hz, delay_usecs, bits_per_word, cs_change, tx_nbits, rx_nbits, word_delay_usecs, pad
TRANSFER = struct.Struct("<QQIIHBBBBBB")
MOST_BYTES, READ = 4096, 0x80
CHIP_MODES = (0, 3)


@dataclass
class SpiDevice:
    """Chip select with a chip.

    Attributes
    ----------
    bus : the chip's. settings : of the device, by the number of its ioctl.
    seen : of each message [mode, bits a word, Hz, first byte, how many bytes].
    """

    bus: Any
    settings: dict[int, int] = field(
        default_factory=lambda: {MODE: 0, LSB_FIRST: 0, BITS: 8, SPEED: 500_000, MODE32: 0}
    )
    seen: list[list[int]] = field(default_factory=list)

    def answer(self, memory: Memory, request: int, _value: int) -> int:
        """Answer an ioctl: 0, or an errno."""
        number, size, direction = request & 0xFF, request >> 16 & 0x3FFF, request >> 30
        if request >> 8 & 0xFF != TYPE:
            return errno.ENOTTY
        argument = memory.at(0, size)
        if argument is None:
            return errno.EFAULT
        if number == MESSAGE:
            if size != TRANSFER.size:
                return errno.EINVAL
            return self._transfer(argument)
        if number not in self.settings:
            return errno.ENOTTY
        if direction == WRITES:
            self.settings[number] = int.from_bytes(argument.bytes(), "little")
        else:
            argument.write(self.settings[number].to_bytes(size, "little"))
        return 0

    def _transfer(self, argument: Memory) -> int:
        _, _, count, hz, delay, bits, cs_change, *rest = TRANSFER.unpack(argument.bytes())
        if not 0 < count <= MOST_BYTES or delay or cs_change or any(rest):
            return errno.EMSGSIZE
        sent, received = argument.at(0, count), argument.at(8, count)
        if sent is None or received is None:
            return errno.EFAULT
        first, *data = sent.bytes()
        bits, hz = bits or self.settings[BITS], hz or self.settings[SPEED]
        self.seen.append([self.settings[MODE], bits, hz, first, count])
        if self.settings[MODE] not in CHIP_MODES or bits != 8 or self.settings[LSB_FIRST]:
            received.write(b"\xff" * count)
        elif first & READ:
            received.write(b"\xff" + self.bus.read(first & ~READ, len(data)).data)
        else:
            self.bus.write(first, bytes(data))
            received.write(b"\xff" * count)
        return 0
