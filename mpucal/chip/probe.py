"""Accesses that identify the chip: foreign chips are refused by reading alone, then the behaviour is tested.

identity.py decides from the replies, live and from a capture.
"""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime

from ..errors import ChipError
from . import registers as reg
from .families import PARTS, families_with_fifo, known_parts
from .port import Port

# Awake after a reset a chip takes 8000 samples a second, and 293 frames fill the largest FIFO; clones may be slower.
COUNT_NS, COUNTS = 15_000_000, 45
IDENTITY_TRIES = 5
PROBED_SAMPLES, PROBE_INTERVAL_NS = 8, 10_000_000

# In every part this bit reads 0, and the count stays below this.
POWER_UNUSED = reg.PWR_MGMT_1_DEVICE_RESET
FIFO_COUNT_MAX = 4096


def read_identity(port: Port) -> int:
    """Read WHO_AM_I; if no part answers so, refuse a chip whose other registers are not an MPU's.

    Raises
    ------
    ChipError : a foreign chip, which must not be written to.
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
            f"the chip answers 0x{who_am_i:02x} to WHO_AM_I and does not have an MPU's registers",
            f"check which chip is at this address (known are {known_parts()})",
        )
    return who_am_i


def _read_stable_identity(port: Port) -> int:
    """Read WHO_AM_I until two consecutive reads agree (bit-flip guard)."""
    before = None
    for _ in range(IDENTITY_TRIES):
        who_am_i = port.read(reg.WHO_AM_I, 1)[0]
        if who_am_i == before:
            return who_am_i
        before = who_am_i
    raise ChipError(
        "the chip's answer to WHO_AM_I changes with each read",
        "shorten the wires, check the pull-ups, or slow the bus down",
    )


def probe(port: Port) -> None:
    """Measure the FIFO's size of a chip that was reset and is awake, and read the accelerometer for its sensitivity.

    Raises
    ------
    ChipError : the FIFO does not fill.
    """
    full = _fill_fifo(port)
    if full is None:
        raise ChipError(
            "the chip's FIFO does not fill as its register map says",
            "switch its supply off and on; if that does not help, the chip is broken or not an MPU",
        )
    if any(family.widest_fifo_bytes for family in families_with_fifo(full)):
        # The FIFO is stopped: no document describes a change of size while it runs.
        port.write(reg.ACCEL_CONFIG2, reg.FIFO_SIZE)
        if _fill_fifo(port) is None:
            port.write(reg.ACCEL_CONFIG2, 0)
    if any(family.half_range_revision for family in families_with_fifo(full)):
        for _ in range(PROBED_SAMPLES):
            port.sleep(PROBE_INTERVAL_NS)
            port.read(reg.ACCEL_XOUT_H, 6)


def _fill_fifo(port: Port) -> int | None:
    """Fill the FIFO, and return the number of bytes at which it stays; 0 if it is empty, None if it never stays.

    The FIFO is stopped before and after.
    """
    port.write(reg.FIFO_EN, reg.FIFO_EN_FRAME)
    port.read(reg.FIFO_EN, 1)
    port.write(reg.USER_CTRL, reg.USER_CTRL_FIFO_EN)
    full, before, most = None, 0, 0
    for _ in range(COUNTS):
        port.sleep(COUNT_NS)
        count = int.from_bytes(port.read(reg.FIFO_COUNT_H, 2), "big")
        if count and count == before:
            full = count
            break
        before, most = count, max(most, count)
    port.write(reg.FIFO_EN, 0)
    port.write(reg.USER_CTRL, 0)
    return full if most else 0


def _is_clock_time(head: bytes) -> bool:
    """Return True if the first seven registers are a time: second, minute, hour, weekday, day, month, year in BCD."""
    # The upper bits hold flags: clock halt, 12 h mode, century.
    digits = (f"{byte & mask:02x}" for byte, mask in zip(head, (0x7F, 0x7F, 0x3F, 0x07, 0x3F, 0x1F, 0xFF), strict=True))
    with suppress(ValueError):
        datetime.strptime(" ".join(digits), "%S %M %H 0%u %d %m %y")
        return True
    return False
