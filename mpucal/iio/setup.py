"""Setup of an IIO device: its attributes are read, changed for the measurement, and restored afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext, suppress

from ..chip.config import Config
from ..chip.port import Port
from ..data import AXES
from ..errors import BusError, ChipError, NoAnswer
from .attributes import ACCEL, GYRO, KINDS, SCALE_TOLERANCE, TEMP, TIMESTAMP, bits_of, full_scale, parse_available
from .decode import ENABLE, FREQUENCY, IioDecoder

# Most bytes of one attribute; and of a list of names, or of one read from a buffer.
TEXT_BYTES, LIST_BYTES = 4096, 65536
TRIGGER, CLOCK, LENGTH, WATERMARK = (
    "trigger/current_trigger",
    "current_timestamp_clock",
    "buffer/length",
    "buffer/watermark",
)
TRIGGERS = "triggers"
# Value of --trigger: poll without a buffer.
POLLED = "none"
# Time that the kernel's buffer holds.
BUFFER_S = 2.0
# Ends of the names of the attributes that the driver reads.
READ_SUFFIXES = (
    "name",
    "mount_matrix",
    "_matrix",
    "_scale",
    "_offset",
    "_calibbias",
    FREQUENCY,
    "_available",
    "_type",
    "_index",
    "_en",
)


class DeviceSetup:
    """Attributes and buffer of a device.

    Parameters
    ----------
    files : of the kernel, which `decoder` follows. kinds : of its sensors that are used, ACCEL and GYRO.

    Attributes
    ----------
    names : of all its attributes.

    Raises
    ------
    BusError : no such device. ChipError : no such sensor.
    """

    def __init__(self, files: Port, decoder: IioDecoder, device: str, kinds: Sequence[str]) -> None:
        self._files, self._decoder, self.device, self.kinds = files, decoder, device, kinds
        self._old: list[tuple[str, str]] = []
        self.names = frozenset(self.read("", LIST_BYTES).split("\n"))
        for kind in kinds:
            if not {f"{kind}_{axis}_raw" for axis in AXES} <= self.names:
                raise ChipError(
                    f"{device} has no {KINDS[kind]}",
                    "give the devices of both: --iio accel=iio:deviceN,gyro=iio:deviceM"
                    " (`mpucal doctor --iio iio:device0` names them)",
                )
        foreign = tuple(f"{kind}_" for kind in (ACCEL, GYRO) if kind not in kinds)
        for name in sorted(self.names):
            if name.endswith(READ_SUFFIXES) and not name.startswith(foreign):
                try:
                    self.read(name)
                except BusError as error:
                    # A driver may list an attribute and still not support it.
                    if isinstance(error, NoAnswer):
                        raise

    def read(self, name: str, count: int = TEXT_BYTES) -> str:
        """Read the text of an attribute; "": the list of all names."""
        return self._files.read(f"{self.device}/{name}", count).decode(errors="replace").strip()

    def read_frames(self) -> None:
        """Read the frames in the buffer, up to LIST_BYTES."""
        self._files.read(self.device, LIST_BYTES)

    def set(self, name: str, text: str) -> str:
        """Write an attribute if its value differs, and return its value afterwards."""
        held = self.read(name)
        if held == text or _equal(held, text):
            return held
        self._write(name, text)
        self._old.append((name, held))
        return self.read(name)

    def restore(self) -> None:
        """Write the old values, the last one first; raise BusError if that fails."""
        while self._old:
            self._write(*self._old.pop())

    def _write(self, name: str, text: str) -> None:
        self._files.write_block(f"{self.device}/{name}", text.encode())

    def start(self, config: Config, trigger: str | None) -> bool:
        """Set rate and ranges, and start the buffer if there is one; return True if a buffer runs.

        Raises
        ------
        BusError : an attribute cannot be written, or another program reads the buffer. ChipError : no trigger.
        """
        names = self.names
        buffered = ENABLE in names and trigger != POLLED
        if buffered and self.read(ENABLE) == "1":
            raise BusError(
                f"another program reads the buffer of {self.device}",
                f"stop it (`sudo fuser -v /dev/{self.device}` names it), or if there is none:"
                f" echo 0 | sudo tee /sys/bus/iio/devices/{self.device}/{ENABLE}",
            )
        # Polling works without permission to write, with the present settings.
        with nullcontext() if buffered else suppress(BusError):
            self._set_scales(config)
            self._set_rate(config)
        if not buffered:
            return False
        if TRIGGER in names:
            self._choose_trigger(trigger)
        if CLOCK in names:
            self.set(CLOCK, "monotonic")
        self._enable_channels()
        rate_hz = self._decoder.rate_hz(self.device) or config.rate_hz
        self.set(LENGTH, str(round(BUFFER_S * rate_hz)))
        if WATERMARK in names:
            self.set(WATERMARK, str(max(1, round(config.period_s * rate_hz))))
        self.set(ENABLE, "1")
        # A first read reports another program that has the buffer open.
        self.read_frames()
        return True

    def _set_rate(self, config: Config) -> None:
        """Set the slowest rate that is as fast as requested, else the fastest."""
        for name in (FREQUENCY, *(f"{kind}_{FREQUENCY}" for kind in self.kinds)):
            if name in self.names:
                offered = parse_available(self.read(f"{name}_available")) if f"{name}_available" in self.names else []
                wanted = min(
                    (hz for hz in offered if hz >= config.rate_hz), default=max(offered, default=config.rate_hz)
                )
                self.set(name, f"{wanted:g}")

    def _set_scales(self, config: Config) -> None:
        """Set the smallest range that is as large as requested, if the sensor has several."""
        wanted = {ACCEL: config.accel_range_g, GYRO: config.gyro_range_dps}
        for kind in self.kinds:
            name = f"{kind}_scale"
            bits = bits_of(kind, self._decoder.texts(self.device), self._decoder.elements(self.device))
            if bits is None or not {name, f"{name}_available"} <= self.names:
                continue
            texts = self.read(f"{name}_available").split()
            ranges = {text: full_scale(kind, scale, bits) for text in texts for scale in parse_available(text)}
            enough = {text: value for text, value in ranges.items() if value * (1.0 + SCALE_TOLERANCE) >= wanted[kind]}
            if ranges:
                self.set(name, min(enough, key=enough.__getitem__) if enough else max(ranges, key=ranges.__getitem__))

    def _choose_trigger(self, trigger: str | None) -> None:
        """Set the named trigger; without a name keep the present one, or set the device's own."""
        held = self.read(TRIGGER)
        if trigger is None and held:
            return
        there = self._files.read(TRIGGERS, LIST_BYTES).decode(errors="replace").split()
        own = f"{self.read('name')}-dev{self.device.removeprefix('iio:device')}"
        wanted = trigger or (own if own in there else "")
        if wanted not in there:
            named = f"no trigger {wanted}" if wanted else f"no trigger for the buffer of {self.device}"
            listed = (
                f"available: {', '.join(there)}" if there else "none is available: load iio-trig-hrtimer and create one"
            )
            raise ChipError(f"there is {named}", f"use --trigger NAME ({listed}), or --trigger {POLLED}, which polls")
        self.set(TRIGGER, wanted)

    def _enable_channels(self) -> None:
        """Enable the channels of the sensors, and no others.

        Raises
        ------
        ChipError : the buffer has no time stamps.
        """
        wanted = {f"scan_elements/{kind}_{axis}_en" for kind in self.kinds for axis in AXES}
        stamp = f"scan_elements/{TIMESTAMP}_en"
        if not wanted | {stamp} <= self.names:
            raise ChipError(f"the buffer of {self.device} has no time stamps", f"use --trigger {POLLED}, which polls")
        wanted |= {stamp, f"scan_elements/{TEMP}_en"}
        for name in sorted(self.names):
            if name.startswith("scan_elements/") and name.endswith("_en"):
                self.set(name, "1" if name in wanted else "0")


def _equal(one: str, other: str) -> bool:
    try:
        return float(one) == float(other)
    except ValueError:
        return False
