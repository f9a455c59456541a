"""The accesses that tell which chip it is: strangers are refused by reading alone, then its behaviour is tried.

identity.py decides from the replies, live and from a capture.
"""

from __future__ import annotations

from ..errors import ChipError
from . import registers as reg
from .families import PARTS, families_with_fifo, known_parts
from .port import Port

MS = 1_000_000

# Awake after a reset a chip takes 8000 samples a second, and 293 frames fill the largest FIFO; clones may be slower.
LOOK_NS = 15 * MS
LOOKS = 45
IDENTITY_TRIES = 5
SIGHTS, SIGHT_NS = 8, 10 * MS

# What every part knows of these two: unused bits are 0.
POWER_UNUSED = reg.PWR_MGMT_1_DEVICE_RESET
FIFO_COUNT_MAX = 4096


def read_identity(port: Port) -> int:
    """WHO_AM_I, and where no part answers so, a look at whether this may be one at all.

    Raises
    ------
    ChipError : it is something else, which must not be written to.
    """
    who_am_i = _read_stable_identity(port)
    if who_am_i in PARTS:
        return who_am_i
    head = port.read(0, 7)
    power = port.read(reg.PWR_MGMT_1, 1)[0]
    count = int.from_bytes(port.read(reg.FIFO_COUNT_H, 2), "big")
    if _is_clock_time(head):
        raise ChipError(
            "the chip at this address is a real-time clock (a DS1307 or DS3231), not an MPU",
            "tie the MPU's AD0 to VCC and give --address 0x69",
        )
    if who_am_i in (0x00, 0xFF) and set(head) == {who_am_i}:
        cause = "nothing drives SDA while it is read" if who_am_i else "SDA stays low while it is read"
        raise ChipError(
            f"every register reads 0x{who_am_i:02x}: {cause}",
            "check SDA, SCL and GND, the connectors and the pull-ups, and that the chip has its supply",
        )
    if who_am_i in (0x00, 0xFF) or power & POWER_UNUSED or count > FIFO_COUNT_MAX:
        raise ChipError(
            f"the chip answers 0x{who_am_i:02x} to WHO_AM_I and has no MPU's registers",
            f"check which chip is at this address (known are {known_parts()})",
        )
    return who_am_i


def _read_stable_identity(port: Port) -> int:
    """What WHO_AM_I shows twice in a row: everything depends on it, and a bit may flip on the way."""
    before = None
    for _ in range(IDENTITY_TRIES):
        who_am_i = port.read(reg.WHO_AM_I, 1)[0]
        if who_am_i == before:
            return who_am_i
        before = who_am_i
    raise ChipError(
        "the chip answers something else to WHO_AM_I each time",
        "shorten the wires, check the pull-ups, or slow the bus down",
    )


def probe(port: Port) -> None:
    """Fill the FIFO of a chip that was reset and is awake, if it has one, and see what it shows of gravity.

    Raises
    ------
    ChipError : its FIFO does not fill.
    """
    full = _fill_fifo(port)
    if full is None:
        raise ChipError(
            "the chip's FIFO does not fill as its register map says",
            "take its supply away for a moment; if it stays so, the chip is broken or no MPU",
        )
    if any(family.widest_fifo_bytes for family in families_with_fifo(full)):
        # while the FIFO is stopped: what a change of size does to one that runs is nowhere written
        port.write(reg.ACCEL_CONFIG2, reg.FIFO_SIZE)
        if _fill_fifo(port) is None:
            port.write(reg.ACCEL_CONFIG2, 0)
    if any(family.half_range_revision for family in families_with_fifo(full)):
        for _ in range(SIGHTS):
            port.sleep(SIGHT_NS)
            port.read(reg.ACCEL_XOUT_H, 6)


def _fill_fifo(port: Port) -> int | None:
    """How many bytes the FIFO holds once they do not get more; None where they never do. Stopped before and after.

    0 where it stays empty.
    """
    port.write(reg.FIFO_EN, reg.FIFO_EN_FRAME)
    port.read(reg.FIFO_EN, 1)
    port.write(reg.USER_CTRL, reg.USER_CTRL_FIFO_EN)
    full, before, most = None, 0, 0
    for _ in range(LOOKS):
        port.sleep(LOOK_NS)
        count = int.from_bytes(port.read(reg.FIFO_COUNT_H, 2), "big")
        if count and count == before:
            full = count
            break
        before, most = count, max(most, count)
    port.write(reg.FIFO_EN, 0)
    port.write(reg.USER_CTRL, 0)
    return full if most else 0


def _is_clock_time(head: bytes) -> bool:
    """Whether the first seven registers are seconds, minutes, hours, weekday, day, month, year, as decimal digits."""
    low = (0, 0, 0, 1, 1, 1, 0)
    high = (59, 59, 23, 7, 31, 12, 99)
    # the clock's halt flag, 12 h mode and the century are flags in the upper bits
    masks = (0x7F, 0x7F, 0x3F, 0x07, 0x3F, 0x1F, 0xFF)
    for byte, mask, least, most in zip(head, masks, low, high, strict=True):
        tens, ones = divmod(byte & mask, 16)
        if ones > 9 or not least <= 10 * tens + ones <= most:
            return False
    return True
