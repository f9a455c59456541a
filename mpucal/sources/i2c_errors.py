"""Error numbers of the kernel for an I2C bus, converted to sentences.

Source: Linux Documentation/i2c/fault-codes.rst.
"""

from __future__ import annotations

import errno
from collections.abc import Sequence
from pathlib import Path

from ..errors import BusError, BusHeld, NoAnswer

DEVICES = Path("/dev")
SYSFS_DEVICES = Path("/sys/bus/i2c/devices")

WIRES = "check VCC, GND, SDA and SCL, and that AD0 is tied to GND (0x68) or to VCC (0x69)"

_TRANSFER = {
    errno.EIO: (
        "a transfer broke off",
        "check the connectors, shorten the wires, or use a slower bus",
    ),
    errno.EAGAIN: ("another master took the I2C bus", "do not use another master on this bus"),
    errno.EBUSY: (
        "a driver of the kernel holds the chip",
        "remove its overlay, or: echo {chip} | sudo tee /sys/bus/i2c/devices/{chip}/driver/unbind; but if it is a"
        " clock's driver (rtc-ds1307), keep it, tie AD0 to VCC and give --address 0x69",
    ),
    errno.EOPNOTSUPP: (
        "the adapter does not support this transfer",
        "connect the chip to another adapter",
    ),
    errno.ENODEV: ("the adapter is gone", "plug it in again, and start again"),
}


def device_error(error: OSError, path: str, kind: str, group: str, there: str) -> BusError:
    """Convert the error of the device at `path`.

    Parameters
    ----------
    kind : such as "an I2C bus". group : of the users who may use it. there : remedy for a wrong path.
    """
    name = kind.partition(" ")[2]
    if error.errno == errno.ENOENT:
        return BusError(f"there is no {name} {path}", there)
    if error.errno in (errno.EACCES, errno.EPERM):
        remedy = f"add yourself to its group: `sudo usermod -aG {group} $USER`, then log in again"
        return BusError(f"no permission to use {path}", remedy)
    if error.errno in (errno.ENOTTY, errno.EISDIR, errno.EINVAL):
        return BusError(f"{path} is not {kind}", there)
    if error.errno in (errno.ENXIO, errno.ENODEV, errno.ESHUTDOWN):
        return BusError(f"the {name} {path} is gone", "plug it in or load its driver, and start again")
    return BusError(f"{path} does not work ({error.strerror})", "check the wires and the driver, and start again")


def transfer_error(error: OSError, path: str, address: int) -> BusError:
    """Convert the error of a failed transfer with the chip at `address`."""
    if error.errno != errno.EBUSY and path.startswith("/") and not Path(path).exists():
        # A USB adapter that was unplugged reports EIO.
        what, remedy = _TRANSFER[errno.ENODEV]
        return BusError(f"{what} ({path})", remedy)
    if error.errno in (errno.EREMOTEIO, errno.ENXIO):
        return no_answer_error(path, (address,))
    if error.errno == errno.ETIMEDOUT:
        return BusHeld(
            f"the I2C bus does not become free (0x{address:02x} on {path})",
            "a wire holds SDA or SCL low, or pull-ups are missing: check for shorts,"
            " and switch the chip's supply off and on",
        )
    what, remedy = _TRANSFER.get(
        error.errno or 0,
        (f"a transfer failed ({error.strerror})", "check the wires, and start again"),
    )
    chip = f"{_number(path) or 'N'}-{address:04x}"
    if error.errno == errno.EBUSY and (iio := _iio_device(chip)):
        remedy = f"use --iio {iio} instead of --bus; or {remedy}"
    return BusError(f"{what} (0x{address:02x} on {path})", remedy.format(chip=chip))


def no_answer_error(path: str, addresses: Sequence[int]) -> NoAnswer:
    """Return the error of a bus on which nothing acknowledges any of `addresses`."""
    places = " or ".join(f"0x{address:02x}" for address in addresses)
    number = _number(path)
    scan = f"; `i2cdetect -y {number}` shows which addresses answer" if number else ""
    return NoAnswer(f"nothing answers at {places} on {path}", WIRES + scan)


def _iio_device(chip: str) -> str:
    """Return the IIO device that a driver of the kernel made of `chip`; empty if there is none."""
    return next((path.name for path in sorted((SYSFS_DEVICES / chip).glob("iio:device*"))), "")


def _number(path: str) -> str:
    """Return the number of the adapter; empty if its path has none."""
    number = path.rpartition("i2c-")[2]
    return number if number.isdecimal() else ""


def other_buses() -> str:
    """Return the remedy for a wrong bus: the buses that there are."""
    buses = sorted(str(path) for path in DEVICES.glob("i2c-*"))
    if buses:
        return f"use one of {', '.join(buses)}"
    return "enable I2C (on a Raspberry Pi: `sudo raspi-config nonint do_i2c 0`) and load `i2c-dev`"
