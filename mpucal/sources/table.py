"""Table of sources: one row for each kind, from which options, help, error messages and documentation are made.

A new source is a module that opens it and a row here. The module and its library are imported when a source of that
kind is opened.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from ..chip.config import Config
from ..chip.registers import ACCEL_RANGES_G, DLPF_CODES, GYRO_RANGES_DPS, MAX_RATE_HZ, USABLE_ADDRESSES
from ..origin import Origin
from .kind import Option, SourceKind


def bus_name(text: str) -> str:
    """Convert the name of a bus: the number of an adapter to its path, and a kind's word to lower case."""
    if not text:
        raise ValueError("no bus was named: give /dev/i2c-N, or sim.")
    word, colon, rest = text.partition(":")
    if word.lower() in {kind.word for kind in SOURCES if kind.option is BUS}:
        return word.lower() + colon + rest
    return f"/dev/i2c-{text}" if text.isdecimal() else text


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """Return a parser of whole numbers from `least` to `most`, decimal or 0x hexadecimal."""

    def parse(text: str) -> int:
        try:
            number = int(text, 0)
        except ValueError:
            raise ValueError(f"{text!r} is not a whole number.") from None
        if number < least or (most is not None and number > most):
            low, high = (f"{of:#04x}" if "x" in text.lower() and of is not None else of for of in (least, most))
            raise ValueError(f"{text} is not {low} or more." if most is None else f"{text} is not {low} to {high}.")
        return number

    return parse


def number(text: str) -> float:
    """Parse a finite number."""
    try:
        if math.isfinite(value := float(text)):
            return value
    except ValueError:
        pass
    raise ValueError(f"{text!r} is not a number.")


def pins(text: str) -> tuple[int | str, ...]:
    """Parse SDA,SCL as numbers or names of pins; empty without pins."""
    named = tuple(int(pin) if pin.isdecimal() else pin for pin in text.split(",") if pin)
    if len(named) not in (0, 2):
        raise ValueError(f"{text!r} is not two pins, SDA,SCL.")
    return named


BUS = Option("bus", metavar="BUS", parse=bus_name)
SPI = Option("spi", metavar="DEVICE")
IIO = Option("iio", metavar="DEVICE")
SERIAL = Option("serial", metavar="PORT[:BAUD]", bare="")
MAVLINK = Option("mavlink", metavar="URL")
REPLAY = Option("replay", metavar="FILE", parse=Path)

ADDRESS = Option(
    "address",
    "I2C address; by default 0x68, then 0x69.",
    "ADDRESS",
    whole_number(USABLE_ADDRESSES[0], USABLE_ADDRESSES[-1]),
)
TRIGGER = Option("trigger", "Trigger of the buffer; by default its own; none: poll instead.", "NAME")
MICROPYTHON = Option(
    "micropython",
    "Run the bridge on a board with MicroPython; the chip is on the board's I2C pins, or on these.",
    "SDA,SCL",
    pins,
    bare="",
)
SEED = Option("seed", "Number of the simulated sensor and hand.", "N", whole_number(0))
SYSTEM = Option("system", "Number of the vehicle, if there are several.", "N", whole_number(1, 255))
SOURCE_SYSTEM = Option("source_system", "MAVLink id of mpucal itself; by default 254.", "N", whole_number(1, 255))
PREPARE = Option(
    "prepare",
    "PX4 only, vehicle level: assign missing accelerometer IDs and pause offset learning.",
    "yes|no",
    choices=("yes", "no"),
    bare="yes",
)
SIGNING_KEY = Option(
    "signing_key", "MAVLink 2 key: 32 bytes, 64 hexadecimal digits, or a passphrase.", "FILE", parse=Path
)

RATE = Option("rate", f"Samples a second, up to {MAX_RATE_HZ:g}.", "HZ", number, default=float(Config.rate_hz))
DLPF = Option(
    "dlpf",
    "Low-pass filter: 1 (184 Hz) to 6 (5 Hz); 0 (260 Hz) for an MPU-6050 only.",
    "CODE",
    whole_number(min(DLPF_CODES), max(DLPF_CODES)),
    default=Config.dlpf,
)
ACCEL_RANGE = Option("accel_range", "±g.", choices=tuple(map(str, ACCEL_RANGES_G)), default=f"{Config.accel_range_g}")
GYRO_RANGE = Option(
    "gyro_range", "±deg/s.", choices=tuple(map(str, GYRO_RANGES_DPS)), default=f"{Config.gyro_range_dps}"
)
CHIP_SETTINGS = (RATE, DLPF, ACCEL_RANGE, GYRO_RANGE)

CHIP = partial(SourceKind, origin=Origin.CHIP, settings=CHIP_SETTINGS)
ADAPTER = partial(
    CHIP,
    what="a chip on a USB adapter",
    option=BUS,
    opener="mpucal.sources.usb_i2c:open_source",
    options=(ADDRESS,),
    doctor="mpucal.doctor.examine:examine_chip_alone",
    host="mpucal.doctor.host:examine_adapters",
)
DEVICE = partial(
    SourceKind,
    option=IIO,
    origin=Origin.DEVICE,
    settings=(RATE, ACCEL_RANGE, GYRO_RANGE),
    doctor="mpucal.iio_device.doctor:examine_iio",
)
VEHICLE = partial(
    SourceKind,
    option=MAVLINK,
    origin=Origin.VEHICLE,
    options=(SYSTEM, SOURCE_SYSTEM, SIGNING_KEY, PREPARE),
    settings=(RATE,),
    doctor="mpucal.vehicle.doctor:examine_vehicle",
)

SOURCES = [
    CHIP(
        what="a chip on an I2C bus of this computer",
        option=BUS,
        forms="/dev/i2c-N or N",
        opener="mpucal.sources.i2c:open_source",
        options=(ADDRESS,),
        doctor="mpucal.doctor.examine:examine_chip",
        host="mpucal.doctor.host:examine_host",
        found="mpucal.sources.i2c:found_chips",
    ),
    CHIP(
        what="the simulated chip",
        option=BUS,
        word="sim",
        forms="sim[:key=value,...] for the simulated chip",
        opener="mpucal.simulated.chip:open_source",
        options=(SEED,),
        title="simulated chip",
        doctor="mpucal.doctor.examine:examine_chip",
    ),
    ADAPTER(
        word="ftdi",
        forms="ftdi://..., a URL of pyftdi (FT232H); needs the extra usb",
        found="mpucal.sources.usb_i2c:adapters",
    ),
    ADAPTER(word="mcp2221", forms="mcp2221 or mcp2221:SERIAL; needs the extra usb"),
    CHIP(
        what="a chip behind a microcontroller with the bridge's firmware",
        option=SERIAL,
        forms="a board with the bridge's firmware: /dev/ttyX or COMn, or a URL such as socket://HOST:PORT",
        opener="mpucal.bridge:open_source",
        options=(ADDRESS, MICROPYTHON),
        store="mpucal.bridge:open_store",
        doctor="mpucal.bridge.doctor:examine_bridge_and_chip",
        found="mpucal.bridge.port_errors:boards",
    ),
    CHIP(
        what="a chip on an SPI bus of this computer",
        option=SPI,
        forms="/dev/spidevB.C[:HZ]; needs the extra spi",
        opener="mpucal.sources.spi:open_source",
        doctor="mpucal.doctor.examine:examine_chip_alone",
    ),
    DEVICE(
        what="a sensor with a Linux kernel (IIO) driver",
        forms="iio:deviceN, or accel=iio:deviceN,gyro=iio:deviceM",
        opener="mpucal.iio_device.source:open_source",
        options=(TRIGGER,),
        found="mpucal.iio_device.source:found_devices",
    ),
    DEVICE(
        what="a simulated sensor with a kernel driver",
        word="sim",
        forms="sim[:key=value,...] for the simulated chip with a simulated driver",
        opener="mpucal.simulated.iio:open_source",
        options=(TRIGGER, SEED),
        title="simulated sensor of the kernel",
    ),
    VEHICLE(
        what="a vehicle over MAVLink",
        forms="udp:[HOST:]PORT, udpout:HOST:PORT, tcp:HOST:PORT, or /dev/ttyX[:BAUD]",
        opener="mpucal.vehicle.source:open_source",
        found="mpucal.bridge.port_errors:autopilots",
    ),
    VEHICLE(
        what="the simulated vehicle",
        word="sim",
        forms="sim[:key=value,...] for the simulated vehicle",
        opener="mpucal.simulated.vehicle:open_source",
        options=(SYSTEM, SOURCE_SYSTEM, SIGNING_KEY, PREPARE, SEED),
        title="simulated vehicle",
    ),
    SourceKind(
        what="the replay of a capture",
        option=REPLAY,
        forms="a capture to replay: .mcap, .tlog, or the folder of a session",
        opener="mpucal.sources.replayed:open_source",
        origin=Origin.FILE,
        instead="`mpucal calibrate`, `mpucal apply` and `mpucal show` read a capture",
        title="replay of {}",
    ),
]


def kinds_for(command: str) -> list[SourceKind]:
    """Return the kinds of source that a command takes."""
    return [kind for kind in SOURCES if command in kind.commands]


def matching_kinds(values: Mapping[str, Any]) -> list[SourceKind]:
    """Return the kinds that the options' values select: one for each of their options that has a value."""
    selected: dict[Option, SourceKind] = {}
    # A kind that needs a word has priority over one that does not.
    for kind in sorted(SOURCES, key=lambda kind: bool(kind.word)):
        if kind.matches(values):
            selected[kind.option] = kind
    return [selected[option] for option in unique(kind.option for kind in SOURCES) if option in selected]


def source_title(values: Mapping[str, Any]) -> str:
    """Return the title of the selected source; empty without one."""
    kinds = matching_kinds(values)
    return kinds[0].title.format(values[kinds[0].option.name]) if kinds else ""


def unique(options: Iterable[Option]) -> list[Option]:
    """Remove duplicates, in order."""
    return list(dict.fromkeys(options))
