"""Sensors with a driver of the Linux kernel: their attributes in sysfs and their buffers in /dev, without libiio.

Source: Linux Documentation/driver-api/iio and Documentation/ABI/testing/sysfs-bus-iio.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..chip.access import Reply
from ..errors import BusError, CaptureError, NoAnswer
from ..files.mcap import Capture
from ..iio import IIO_VERSION
from ..iio.driver import Devices, IioDriver
from ..iio.setup import LIST_BYTES, TEXT_BYTES, TRIGGERS
from ..origin import Origin
from ..session.plan import Plan
from ..sources.chip import OpenedChip
from ..sources.host_bus import HostBus, converting
from ..sources.kind import Request
from ..sources.opened_source import Say
from ..sources.recorded_parts import RecordedParts

SYSFS, DEVICES = Path("/sys/bus/iio/devices"), Path("/dev")
RULES = Path("/etc/udev/rules.d")
ATTRIBUTE_GROUPS = ("buffer", "scan_elements", "trigger")
# Attributes that keep what is written to them.
PERSISTENT_SUFFIX = "_calibbias"
# Key of a capture's head: the devices and the trigger.
META_KEY = "iio"
SHOWN_PREFIXES = ("name", "in_", "sampling", "trigger/")
NO_DEVICES = Devices("", "")
GONE_ERRNOS = (errno.ENODEV, errno.ENOENT, errno.ENXIO)


@dataclass
class OpenedIio(OpenedChip):
    """Open IIO devices, one or two; see OpenedSource.

    Attributes
    ----------
    devices : their names. trigger : see IioDriver. rules : folder of udev's rules; None without udev.
    """

    origin = Origin.DEVICE
    version = IIO_VERSION
    devices: Devices = NO_DEVICES
    trigger: str | None = None
    rules: Path | None = None

    def source_meta(self) -> dict[str, Any]:
        """Return the entries for the head of a capture."""
        return {**super().source_meta(), META_KEY: [*self.devices, self.trigger]}

    @classmethod
    def replayed(
        cls, capture: Capture, line: RecordedParts[Any], plan: Plan, _values: Mapping[str, Any], /, **how: Any
    ) -> OpenedIio:
        """See OpenedSource.

        Raises
        ------
        CaptureError : the capture's head does not name the devices.
        """
        try:
            accel, gyro, trigger = capture.meta[META_KEY]
        except (KeyError, TypeError, ValueError) as error:
            raise CaptureError(
                f"the head of {capture.name} does not name the IIO devices", "use `mpucal calibrate`"
            ) from error
        return cls(line, plan, **how, devices=Devices(str(accel), str(gyro)), trigger=trigger)

    @property
    def where(self) -> str:
        """Names of the devices, for messages."""
        return " and ".join(self.devices.each)

    def contents(self) -> dict[str, Any]:
        """Read the attributes; nothing is set up or written."""
        facts: dict[str, Any] = {"where": self.where}
        with closing(self.bus) as files:
            for device in self.devices.each:
                names = files.read(f"{device}/", LIST_BYTES).data.decode().split("\n")
                before = "" if len(self.devices.each) == 1 else f"{device}/"
                for name in names:
                    if name.startswith(SHOWN_PREFIXES) and not name.endswith(("_raw", "_available")):
                        facts[before + name] = files.read(f"{device}/{name}", TEXT_BYTES).data.decode().strip()
        return facts

    def driver(self, bus: Any, name: str, say: Say) -> IioDriver:
        """Make the driver that measures over `bus`."""
        return IioDriver(bus, self.devices, self.plan.config, name, say, self.trigger)


def open_source(request: Request) -> OpenedIio:
    """Open the devices that --iio names.

    Raises
    ------
    UsageError : no names of devices. BusError : there are no such devices, or they cannot be written to.
    """
    devices = Devices.parse(request.value)
    files = IioFiles()
    for device in devices.each:
        files.check(device)
    if request.values.get("writes"):
        files.check_writable(devices.accel)
    return OpenedIio(
        files,
        request.plan,
        words=request.words,
        own_process=True,
        devices=devices,
        trigger=request.values.get("trigger"),
        rules=RULES,
    )


def found_devices() -> list[tuple[str, str]]:
    """List the IIO devices with an accelerometer and a gyroscope: (name, name of the part)."""
    return [
        (path.name, _name(path))
        for path in sorted(SYSFS.glob("iio:device*"))
        if all((path / f"in_{channel}_x_raw").exists() for channel in ("accel", "anglvel"))
    ]


def file_error(error: OSError, device: str, name: str = "the buffer", text: str | None = None) -> BusError:
    """Convert the error of reading the attribute `name` or the buffer, or of writing `text` to an attribute.

    Source: Linux 6.1, drivers/iio/industrialio-buffer.c and industrialio-trigger.c.
    """
    verb = "read" if text is None else "write"
    if error.errno in (errno.EACCES, errno.EPERM):
        remedy = "run it as root (sudo), or use --trigger none, which polls and writes nothing"
        return BusError(f"no permission to {verb} {name} of {device}", remedy)
    if error.errno == errno.EBUSY:
        remedy = f"stop it (`sudo fuser -v /dev/{device}` names it), and start again"
        return BusError(f"another program reads the buffer of {device}", remedy)
    if error.errno in GONE_ERRNOS:
        remedy = "its driver was unbound or its adapter unplugged: bring it back, and start again"
        return NoAnswer(f"{device} is gone", remedy)
    if text is not None and error.errno in (errno.EINVAL, errno.ERANGE):
        what = f"the driver of {device} does not accept {text!r} for {name}"
        return BusError(what, "use another --rate, range or --trigger")
    return BusError(
        f"the driver of {device} cannot {verb} {name} ({error.strerror})",
        "check the sensor's wires and supply, and the output of `dmesg`",
    )


class IioFiles(HostBus):
    """Files of IIO devices; see Bus."""

    def __init__(self) -> None:
        super().__init__()
        self._open: dict[str, int] = {}
        self._before: dict[str, bytes] = {}

    def check(self, device: str) -> None:
        """Raise BusError if there is no such device."""
        if not (SYSFS / device).is_dir():
            there = [f"{path.name} ({_name(path)})" for path in sorted(SYSFS.glob("iio:device*"))]
            remedy = (
                f"use one of {', '.join(there)}" if there else "load the driver of the sensor, which needs its overlay"
            )
            raise BusError(f"there is no {device}", remedy)

    def check_writable(self, device: str) -> None:
        """Raise BusError if this user may not write calibbias or udev's rules, to which a session writes at its end."""
        for path in (*sorted((SYSFS / device).glob(f"*{PERSISTENT_SUFFIX}")), RULES):
            if not os.access(path, os.W_OK):
                raise BusError(
                    f"{path} cannot be written, and this session is to write to it",
                    "run it as root (sudo), or leave out --to kernel",
                )

    def read(self, register: str, count: int) -> Reply:
        """Read a file as Bus has it; TRIGGERS gives the names of all triggers."""
        device, _, name = register.partition("/")
        if register == TRIGGERS:
            names = [_name(path) for path in sorted(SYSFS.glob("trigger*"))]
            return Reply("\n".join(names).encode(), self.now_ns())
        if register.endswith("/"):
            return Reply("\n".join(self._names(device)).encode(), self.now_ns())
        if not name:
            return self._buffer(device, count)
        with converting(lambda error: file_error(error, device, name)):
            is_sample = name.endswith("_raw")
            reply = self.timed_read(register, count, is_sample, lambda: (SYSFS / register).read_bytes()[:count])
        # The driver reads the count from the chip in between.
        return reply._replace(t_ns=(reply.t_ns + self.now_ns()) // 2)

    def write(self, register: str, data: bytes) -> int:
        """See Bus."""
        device, _, name = register.partition("/")
        t_ns = self.now_ns()
        with converting(lambda error: file_error(error, device, name, data.decode())):
            if not name.endswith(PERSISTENT_SUFFIX) and register not in self._before:
                self._before[register] = (SYSFS / register).read_bytes().strip()
            self._put(register, data)
        return t_ns

    def close(self) -> None:
        """Close the buffers, and restore attributes after an error or Ctrl-C: no driver stops a buffer by itself."""
        for fd in self._open.values():
            os.close(fd)
        self._open = {}
        while self._before:
            register, text = self._before.popitem()
            with suppress(OSError):
                if (SYSFS / register).read_bytes().strip() != text:
                    self._put(register, text)

    def _put(self, register: str, data: bytes) -> None:
        # One unbuffered write gets the driver's refusal at once.
        fd = os.open(SYSFS / register, os.O_WRONLY | os.O_TRUNC)
        try:
            os.write(fd, data)
        finally:
            os.close(fd)

    def _buffer(self, device: str, count: int) -> Reply:
        t_ns = self.now_ns()
        try:
            if device not in self._open:
                self._open[device] = os.open(DEVICES / device, os.O_RDONLY | os.O_NONBLOCK)
            return Reply(os.read(self._open[device], count), t_ns)
        except BlockingIOError:
            return Reply(b"", t_ns)
        except OSError as error:
            raise file_error(error, device) from error

    def _names(self, device: str) -> list[str]:
        """List all attributes, those of the groups with the group's name in front."""
        folder = SYSFS / device
        with converting(lambda error: file_error(error, device, "the attributes")):
            names = [path.name for path in folder.iterdir() if path.is_file()]
            groups = [folder / group for group in ATTRIBUTE_GROUPS if (folder / group).is_dir()]
            return sorted(
                [*names, *(f"{g.name}/{path.name}" for g in groups for path in g.iterdir() if path.is_file())]
            )


def _name(folder: Path) -> str:
    try:
        return (folder / "name").read_text().strip()
    except OSError:
        return "?"
