"""Identification and setup of a chip, and start of its FIFO, in the order of its register map.

Foreign chips are refused by reading alone; then the behaviour is tested, from which identity.py decides, live and from
a capture. Source: RM-MPU-6000A r4.2 registers 104, 106 and 107; the start-up times of both product specifications are
shorter.
"""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime

from ..errors import ChipError
from . import registers as reg
from .config import Settings
from .families import FAMILIES, PARTS, families_with_fifo, known_parts
from .port import Port

# Awake after a reset a chip takes 8000 samples a second, and 293 frames fill the largest FIFO; clones may be slower.
COUNT_NS, COUNTS = 15_000_000, 45
# Reads of WHO_AM_I until two agree, and attempts to wake the chip.
TRIES = 5
PROBED_SAMPLES, PROBE_INTERVAL_NS = 8, 10_000_000

# In every part this bit reads 0, and the count stays below this.
POWER_UNUSED = reg.PWR_MGMT_1_DEVICE_RESET
FIFO_COUNT_MAX = max(family.widest_fifo_bytes or family.fifo_bytes for family in FAMILIES)


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
    for _ in range(TRIES):
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


STARTUP_NS = 100_000_000


def reset(port: Port) -> None:
    """Reset all registers to their values after power-on, the accelerometer's factory trim included."""
    port.write(reg.PWR_MGMT_1, reg.PWR_MGMT_1_DEVICE_RESET)
    port.sleep(STARTUP_NS)
    # Some families sleep now and others do not: identity.py uses this read.
    port.read(reg.PWR_MGMT_1, 1)
    port.write(reg.SIGNAL_PATH_RESET, reg.SIGNAL_PATH_RESET_ALL)
    port.sleep(STARTUP_NS)


def wake(port: Port) -> None:
    """Wake the chip, and select the gyroscope's clock.

    Raises
    ------
    ChipError : the chip does not wake up.
    """
    for _ in range(TRIES):
        port.write(reg.PWR_MGMT_1, reg.CLKSEL_PLL)
        port.sleep(STARTUP_NS)
        held = port.read(reg.PWR_MGMT_1, 1)[0]
        if held == reg.CLKSEL_PLL:
            return
    if not held & reg.PWR_MGMT_1_SLEEP:
        raise ChipError(
            f"bits flip on the bus (PWR_MGMT_1 reads 0x{held:02x} after 0x{reg.CLKSEL_PLL:02x} was written)",
            "shorten the wires, check SDA for shorts and its pull-up, or slow the bus down",
        )
    raise ChipError(
        f"the chip does not wake up (its PWR_MGMT_1 stays at 0x{held:02x})",
        "switch its supply off and on, and check that it gets 3.3 V",
    )


def configure(port: Port, settings: Settings) -> None:
    """Write `settings`, and read them back.

    Raises
    ------
    ChipError : a register does not keep what was written.
    """
    wanted, chip = settings.registers(), settings.part.chip
    for register, value in wanted.items():
        port.write(register, value)
    for register, value in wanted.items():
        held = port.read(register, 1)[0]
        if held != value:
            raise ChipError(
                f"register 0x{register:02x} of the {chip} reads 0x{held:02x} after 0x{value:02x} was written",
                "check its wiring and supply, and that no other program uses it",
            )
    port.sleep(STARTUP_NS)


def is_configured(port: Port, settings: Settings) -> bool:
    """Return True if the chip still holds what `configure` wrote, and is awake."""
    awake = port.read(reg.PWR_MGMT_1, 1)[0] == reg.CLKSEL_PLL
    return awake and all(port.read(register, 1)[0] == value for register, value in settings.registers().items())


def restart_fifo(port: Port, settings: Settings) -> None:
    """Empty and start the FIFO, if there is one; it resets only while disabled (RM-MPU-6000A r4.2, register 106).

    Raises
    ------
    ChipError : the FIFO does not start.
    """
    port.write(reg.FIFO_EN, 0)
    port.write(reg.USER_CTRL, 0)
    port.write(reg.USER_CTRL, reg.USER_CTRL_FIFO_RESET)
    if settings.polled:
        port.read(reg.TEMP_OUT_H, 2)
        return
    port.write(reg.USER_CTRL, reg.USER_CTRL_FIFO_EN)
    port.read(reg.INT_STATUS, 1)
    port.read(reg.TEMP_OUT_H, 2)
    fifo_en = settings.part.family.fifo_en_frame
    port.write(reg.FIFO_EN, fifo_en)
    held = port.read(reg.FIFO_EN, 1) + port.read(reg.USER_CTRL, 1)
    if held != bytes([fifo_en, reg.USER_CTRL_FIFO_EN]):
        raise ChipError(
            f"the chip's FIFO does not start (FIFO_EN and USER_CTRL read {held.hex(' ')})",
            "check its wiring and supply, and that no other program uses it",
        )


def stop_fifo(port: Port) -> None:
    """Stop the FIFO; the chip stays awake."""
    port.write(reg.FIFO_EN, 0)
    port.write(reg.USER_CTRL, 0)
