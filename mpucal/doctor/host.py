"""Examination of the host's side of an I2C bus: device file, adapter, kernel drivers and addresses, or USB adapters.

Source: Linux Documentation/i2c/dev-interface.rst and sysfs; addresses are probed as by i2cdetect of i2c-tools.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ..chip.registers import ADDRESSES, USABLE_ADDRESSES
from ..sources.host_bus import WIRES, transfer_error
from ..sources.i2c import found_chips
from ..sources.usb_i2c import I2C_HZ, adapters
from .finding import Finding, Mark

SYS = Path("/sys")
# These addresses are EEPROMs', which a quick write could upset; a read could upset devices at the others.
READ_ONLY = (*range(0x30, 0x38), *range(0x50, 0x60))
# One slow device holds the bus for a while; a wire that stays low times out at every address, a second each.
HELD_IN_A_ROW = 3

GUESSES = {
    0x0C: "an AK8963 magnetometer (behind an MPU-9250's bypass)",
    0x0D: "a QMC5883L magnetometer",
    0x1E: "an HMC5883L magnetometer",
    0x3C: "an OLED display",
    0x50: "an EEPROM",
    0x57: "an EEPROM (of a DS3231 board)",
    0x68: "an MPU with AD0 low, or a DS1307 or DS3231 clock",
    0x69: "an MPU with AD0 high",
    0x76: "a BMP280 or MS5611",
    0x77: "a BMP180, BMP280 or MS5611",
}
DTPARAM = "on a Raspberry Pi: `dtparam=i2c_arm=on,i2c_arm_baudrate=400000` in /boot/firmware/config.txt, then reboot"


def examine_host(path: str) -> Iterator[Finding]:
    """Examine `path`, an adapter's device file, and the addresses on its bus."""
    number = path.rpartition("-")[2]
    yield _device_file(Path(path))
    if not Path(path).exists():
        return
    yield from _adapter(number)
    yield from _kernel_drivers(number)
    yield from _addresses(path)


def examine_adapters(name: str) -> Iterator[Finding]:
    """List the USB adapters that are plugged in; `name` is the one that was asked for."""
    there = adapters()
    for bus, what in there:
        yield Finding("USB adapter", Mark.OK, f"{what}: --bus {bus}", "", {"bus": bus, "what": what})
    if not there:
        yield Finding("USB adapter", Mark.NOTE, f"none is seen beside {name}", "plug it in; see docs/boards.md")


def _device_file(path: Path) -> Finding:
    try:
        about = path.stat()
    except OSError as error:
        others = ", ".join(sorted(str(other) for other in path.parent.glob("i2c-*"))) or "none"
        remedy = f"enable I2C (buses found: {others}); {DTPARAM}"
        return Finding("device file", Mark.BAD, f"{path}: {error.strerror}", remedy)
    # Windows has no such modules, and no such device file.
    import grp  # noqa: PLC0415
    import pwd  # noqa: PLC0415

    owner, group = _name(pwd.getpwuid, about.st_uid), _name(grp.getgrgid, about.st_gid)
    what = f"{path}, {stat.filemode(about.st_mode)} {owner}:{group}"
    data = {"path": str(path), "mode": stat.filemode(about.st_mode), "owner": owner, "group": group}
    if not stat.S_ISCHR(about.st_mode):
        return Finding("device file", Mark.BAD, f"{what}: not a device", "give /dev/i2c-N", data)
    if not os.access(path, os.R_OK | os.W_OK):
        remedy = "join the group: `sudo usermod -aG i2c $USER`, then log in again"
        return Finding("device file", Mark.BAD, f"{what}: no permission", remedy, data)
    return Finding("device file", Mark.OK, what, "", data)


def _name(look_up: Callable[[int], Any], number: int) -> str:
    try:
        return str(look_up(number)[0])
    except KeyError:
        return str(number)


def _adapter(number: str) -> Iterator[Finding]:
    folder = SYS / "class" / "i2c-dev" / f"i2c-{number}"
    name = _text(folder / "name") or "unnamed"
    speed = _bytes(folder / "device" / "of_node" / "clock-frequency")
    if len(speed) != 4:
        yield Finding("adapter", Mark.OK, f"{name}; configured speed unknown", "", {"name": name})
        return
    hz = int.from_bytes(speed, "big")
    what, data = f"{name}, configured for {hz / 1000:g} kHz", {"name": name, "configured_hz": hz}
    yield Finding.check("adapter", hz >= I2C_HZ, what, DTPARAM, data)


def _kernel_drivers(number: str) -> Iterator[Finding]:
    for address in ADDRESSES:
        link = SYS / "bus" / "i2c" / "devices" / f"{number}-{address:04x}" / "driver"
        try:
            driver = link.readlink().name
        except OSError:
            continue
        mark, what = Mark.BAD, f"{driver} holds 0x{address:02x}"
        remedy = f"remove its overlay, or: echo {number}-{address:04x} | sudo tee {link}/unbind"
        # The driver of a real-time clock must stay: the computer takes its time from there.
        if driver.startswith("rtc-"):
            mark, what = Mark.NOTE, f"{what}: a real-time clock is there"
            remedy = "tie the MPU's AD0 to VCC and give --address 0x69"
        yield Finding("kernel driver", mark, what, remedy, {"driver": driver, "address": address})


def _addresses(path: str) -> Iterator[Finding]:
    import smbus2  # noqa: PLC0415 - only where there is an I2C bus

    bus = smbus2.SMBus()
    try:
        bus.open(path)
    except OSError:
        # The device file has its own finding.
        return
    try:
        can_i2c = bool(bus.funcs & smbus2.I2cFunc.I2C)
        found = _probe_all(bus)
    except TimeoutError as error:
        yield Finding.failed("on the bus", transfer_error(error, path, USABLE_ADDRESSES.start))
        return
    finally:
        bus.close()
    if not can_i2c:
        yield Finding("adapter", Mark.NOTE, "SMBus only: 32 bytes per transfer", "keep to 200 Hz or less")
    words = [f"0x{address:02x}{_guess(address, answer)}" for address, answer in found.items()]
    ours = any(address in ADDRESSES for address in found)
    elsewhere = [] if ours else [other for other, _ in found_chips(Path(path).parent) if other != path]
    remedy = f"it is on another bus: give --bus {elsewhere[0]}" if elsewhere else WIRES
    data = {"addresses": sorted(found), "smbus_only": not can_i2c, "elsewhere": elsewhere}
    yield Finding.check("on the bus", ours, "; ".join(words) or "nothing answers", remedy, data, Mark.BAD)


def _probe_all(bus: Any) -> dict[int, str]:
    """Return the answer of each address that answers; TimeoutError if a wire is held low."""
    found, held = {}, 0
    for address in USABLE_ADDRESSES:
        try:
            answer = _probe(bus, address)
        except TimeoutError:
            held += 1
            if held == HELD_IN_A_ROW:
                raise
            continue
        held = 0
        if answer:
            found[address] = answer
    return found


def _probe(bus: Any, address: int) -> str:
    """Return "there", "busy" if a kernel driver holds the address, or "" if nothing answers; TimeoutError on a hang."""
    try:
        if address in READ_ONLY:
            bus.read_byte(address)
        else:
            bus.write_quick(address)
    except TimeoutError:
        raise
    except OSError as error:
        return "busy" if error.errno == errno.EBUSY else ""
    return "there"


def _guess(address: int, answer: str) -> str:
    if answer == "busy":
        return " (held by a kernel driver)"
    return f", {GUESSES[address]}" if address in GUESSES else ""


def _text(path: Path) -> str:
    return _bytes(path).decode(errors="replace").strip()


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""
