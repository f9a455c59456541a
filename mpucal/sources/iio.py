"""Sensors that drivers of the Linux kernel hold: their attributes in sysfs and their buffers in /dev, without libiio.

Source: Linux Documentation/driver-api/iio and Documentation/ABI/testing/sysfs-bus-iio.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from ..chip.access import Files, Reply
from ..errors import BusError, UsageError
from ..files.mcap import Capture
from ..iio import IIO_VERSION
from ..iio.devices import Devices
from ..iio.driver import IioDriver
from ..iio.setup import LIST_BYTES, TEXT_BYTES, TRIGGERS
from ..session.plan import DRIVER
from .chip import OpenedChip
from .iio_errors import attribute_error, buffer_error
from .kind import Request
from .opened_source import Say

SYSFS, DEVICES = Path("/sys/bus/iio/devices"), Path("/dev")
RULES = Path("/etc/udev/rules.d")
GROUPS = ("buffer", "scan_elements", "trigger")
# what is written there is meant to stay
STAYS = "_calibbias"
# of a capture's head: which devices, and the trigger
OF_IIO = "iio"
SHOWN = ("name", "in_", "sampling", "trigger/")
NOWHERE = Devices("", "")


@dataclass(frozen=True)
class OpenedIio(OpenedChip):
    """One or two devices; see OpenedSource.

    Attributes
    ----------
    devices : which ones. trigger : see IioDriver. rules : the folder of udev's rules; None: no udev knows them.
    """

    devices: Devices = NOWHERE
    trigger: str | None = None
    rules: Path | None = None

    def source_meta(self) -> dict[str, Any]:
        """For the head of a capture."""
        return {**super().source_meta(), DRIVER: IIO_VERSION, OF_IIO: [*self.devices, self.trigger]}

    @property
    def where(self) -> str:
        """The very devices, in words."""
        return " and ".join(self.devices.each)

    def contents(self) -> dict[str, Any]:
        """What its attributes hold now; nothing is set up or written."""
        files: Any = self.bus
        facts: dict[str, Any] = {"where": self.where}
        with closing(files):
            for device in self.devices.each:
                names = files.read(f"{device}/", LIST_BYTES).data.decode().split("\n")
                before = "" if len(self.devices.each) == 1 else f"{device}/"
                for name in names:
                    if name.startswith(SHOWN) and not name.endswith(("_raw", "_available")):
                        facts[before + name] = files.read(f"{device}/{name}", TEXT_BYTES).data.decode().strip()
        return facts

    def driver(self, bus: Any, name: str, say: Say) -> IioDriver:
        """What measures, over `bus`."""
        return IioDriver(bus, self.devices, self.plan.config, name, say, self.trigger)


def iio_replay(replay: OpenedChip, capture: Capture) -> OpenedIio:
    """A replay of what is no chip's; see OpenedIio.source_meta."""
    accel, gyro, trigger = capture.meta[OF_IIO]
    held = {field.name: getattr(replay, field.name) for field in fields(OpenedChip)}
    return OpenedIio(**held, devices=Devices(accel, gyro), trigger=trigger)


def open_source(request: Request) -> OpenedIio:
    """The devices that --iio names.

    Raises
    ------
    UsageError : no names of devices. BusError : there are none such.
    """
    try:
        devices = Devices.parse(request.value)
    except ValueError as error:
        raise UsageError(
            f"--iio: {str(error).partition(': ')[0]}", str(error).partition(": ")[2].rstrip(".")
        ) from error
    files = IioFiles()
    for device in devices.each:
        files.check(device)
    bus: Any = files
    return OpenedIio(
        bus, request.plan, words=request.words, devices=devices, trigger=request.values.get("trigger"), rules=RULES
    )


class IioFiles(Files):
    """The files of IIO devices; the clock is the host's monotonic one.

    Parameters
    ----------
    sysfs : the folder of the devices' folders. dev : of their device files.
    """

    def __init__(self, sysfs: Path | None = None, dev: Path | None = None) -> None:
        self._sysfs, self._dev = sysfs or SYSFS, dev or DEVICES
        self._open: dict[str, int] = {}
        self._before: dict[str, bytes] = {}

    def check(self, device: str) -> None:
        """BusError where there is no such device."""
        if not (self._sysfs / device).is_dir():
            there = [f"{path.name} ({_name(path)})" for path in sorted(self._sysfs.glob("iio:device*"))]
            remedy = (
                f"there are {', '.join(there)}" if there else "load the driver of the sensor, which needs its overlay"
            )
            raise BusError(f"there is no {device}", remedy)

    def read(self, register: str, count: int) -> Reply:
        """See Files; TRIGGERS: the names of all triggers."""
        device, _, name = register.partition("/")
        if register == TRIGGERS:
            names = [_name(path) for path in sorted(self._sysfs.glob("trigger*"))]
            return Reply("\n".join(names).encode(), time.monotonic_ns())
        if register.endswith("/"):
            return Reply("\n".join(self._names(device)).encode(), time.monotonic_ns())
        if not name:
            return self._buffer(device, count)
        begun_ns = time.monotonic_ns()
        with self._told(device, name):
            data = (self._sysfs / register).read_bytes()[:count]
        # a driver asks the chip for a count meanwhile
        return Reply(data, (begun_ns + time.monotonic_ns()) // 2)

    def write(self, register: str, data: bytes) -> int:
        """See Files."""
        device, _, name = register.partition("/")
        t_ns = time.monotonic_ns()
        with self._told(device, name, data.decode()):
            if not name.endswith(STAYS) and register not in self._before:
                self._before[register] = (self._sysfs / register).read_bytes().strip()
            self._put(register, data)
        return t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the monotonic clock shows `t_ns`."""
        time.sleep(max(0, t_ns - time.monotonic_ns()) * 1e-9)

    def close(self) -> None:
        """Let go of the buffers, and put back what an error or Ctrl-C left: no driver ends a buffer by itself."""
        for fd in self._open.values():
            os.close(fd)
        self._open = {}
        while self._before:
            register, text = self._before.popitem()
            with suppress(OSError):
                if (self._sysfs / register).read_bytes().strip() != text:
                    self._put(register, text)

    def _put(self, register: str, data: bytes) -> None:
        # one write without a buffer: the driver refuses it there and then
        fd = os.open(self._sysfs / register, os.O_WRONLY | os.O_TRUNC)
        try:
            os.write(fd, data)
        finally:
            os.close(fd)

    def _buffer(self, device: str, count: int) -> Reply:
        t_ns = time.monotonic_ns()
        try:
            if device not in self._open:
                self._open[device] = os.open(self._dev / device, os.O_RDONLY | os.O_NONBLOCK)
            return Reply(os.read(self._open[device], count), t_ns)
        except BlockingIOError:
            return Reply(b"", t_ns)
        except OSError as error:
            raise buffer_error(error, device) from error

    def _names(self, device: str) -> list[str]:
        """Of all attributes, those of its groups with the group's name before them."""
        folder = self._sysfs / device
        with self._told(device, ""):
            names = [path.name for path in folder.iterdir() if path.is_file()]
            groups = [folder / group for group in GROUPS if (folder / group).is_dir()]
            return sorted(
                [*names, *(f"{g.name}/{path.name}" for g in groups for path in g.iterdir() if path.is_file())]
            )

    @contextmanager
    def _told(self, device: str, name: str, text: str | None = None) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise attribute_error(error, device, name, text) from error


def _name(folder: Path) -> str:
    try:
        return (folder / "name").read_text().strip()
    except OSError:
        return "?"
