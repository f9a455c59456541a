"""Setup of a chip and start of its FIFO, in the order of its register map.

Source: RM-MPU-6000A r4.2 registers 104, 106 and 107; the start-up times of both product specifications are shorter.
"""

from __future__ import annotations

from ..errors import ChipError
from . import registers as reg
from .port import Port
from .settings import Settings

STARTUP_NS = 100_000_000
WAKE_TRIES = 5


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
    for _ in range(WAKE_TRIES):
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
    port.write(reg.FIFO_EN, settings.fifo_en)
    held = port.read(reg.FIFO_EN, 1) + port.read(reg.USER_CTRL, 1)
    if held != bytes([settings.fifo_en, reg.USER_CTRL_FIFO_EN]):
        raise ChipError(
            f"the chip's FIFO does not start (FIFO_EN and USER_CTRL read {held.hex(' ')})",
            "check its wiring and supply, and that no other program uses it",
        )


def stop_fifo(port: Port) -> None:
    """Stop the FIFO; the chip stays awake."""
    port.write(reg.FIFO_EN, 0)
    port.write(reg.USER_CTRL, 0)
