"""Driver of IIO devices: samples come from their buffers, or by polling without buffers.

Its accesses depend on the replies and their times alone, so that a replay makes the same accesses.
IIO_VERSION changes with every change of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from ..chip.access import Bus
from ..chip.config import Config
from ..chip.driver import DEAD_NS
from ..chip.losses import Loss
from ..chip.port import Port
from ..clocks import S
from ..data import AXES, Recording, Samples, Sensor
from ..errors import BusError, ChipError, EndOfCapture, NoAnswer, UsageError
from .attributes import ACCEL, GYRO, TEMP
from .decode import IioDecoder
from .setup import DeviceSetup

DEVICE = re.compile(r"(?:iio:)?(?:device)?(\d+)")


class Devices(NamedTuple):
    """Devices of the two sensors, such as iio:device0."""

    accel: str
    gyro: str

    @property
    def each(self) -> tuple[str, ...]:
        """Devices without duplicates."""
        return tuple(dict.fromkeys(self))

    @property
    def kinds(self) -> dict[str, list[str]]:
        """Sensors of each device: ACCEL, GYRO or both."""
        by_kind = {ACCEL: self.accel, GYRO: self.gyro}
        return {each: [kind for kind, device in by_kind.items() if device == each] for each in self.each}

    @classmethod
    def parse(cls, text: str) -> Devices:
        """Parse iio:device0, or accel=iio:device0,gyro=iio:device1; `iio:` and `device` may be left out.

        Raises
        ------
        UsageError : another text.
        """
        parts = dict(part.partition("=")[::2] for part in text.split(","))
        if set(parts) == {"accel", "gyro"}:
            return cls(_device(parts["accel"]), _device(parts["gyro"]))
        return cls(_device(text), _device(text))


def _device(text: str) -> str:
    found = DEVICE.fullmatch(text.strip())
    if found is None:
        raise UsageError(f"--iio: {text!r} is not a device", "give iio:deviceN, or accel=iio:deviceN,gyro=iio:deviceM")
    return f"iio:device{found.group(1)}"


NO_INTERRUPT_HINT = (
    "it waits for interrupts that do not come: check the chip's INT wire and its line in the device tree. For an"
    " MPU-6050 the driver of Linux 6.1 reads register 0 as the interrupt's status, and drops samples while its bit 0"
    " is 0: use --trigger none, which polls, or unbind the driver and use --bus"
)


class IioDriver:
    """Driver of the accelerometer and the gyroscope of one or two IIO devices.

    Parameters
    ----------
    files : of the kernel. devices : their names. config : requested rate and ranges. name : of the recording.
    say : called with remarks for the user: one sentence each, without a full stop.
    trigger : of the buffers; None: their own; POLLED: no buffers, the channels are polled.

    Attributes
    ----------
    buffered : True if samples come from buffers; valid after `start`.
    """

    def __init__(
        self,
        files: Bus,
        devices: Devices,
        config: Config,
        name: str = "recording",
        say: Callable[[str], None] = lambda _sentence: None,
        trigger: str | None = None,
    ) -> None:
        self._devices, self._config, self._say, self._trigger = devices, config, say, trigger
        self._decoder = IioDecoder(name)
        self._files = Port(files, self._decoder.feed, tries=1)
        self._each: list[DeviceSetup] = []
        self.buffered = False
        self._next_ns = self._fruitless_ns = self._warm_ns = 0

    def now_ns(self) -> int:
        """Return the last time of the host's monotonic clock."""
        return self._files.now_ns

    def texts(self, device: str) -> dict[str, str]:
        """Return the attributes of a device as they were last read."""
        return dict(self._decoder.texts(device))

    def start(self) -> Sensor:
        """Read the devices' attributes, set rate and ranges, and start to measure.

        Raises
        ------
        BusError : no such device, or it cannot be written. ChipError : no such sensor, or no trigger.
        """
        self._each = [DeviceSetup(self._files, self._decoder, *each) for each in self._devices.kinds.items()]
        try:
            running = [each.start(self._config, self._trigger) for each in self._each]
            if any(running) and not all(running):
                raise ChipError("one of the two devices has no buffer", "use --trigger none, which polls both")
        except (BusError, ChipError):
            self._restore()
            raise
        self.buffered = all(running)
        if not self.buffered:
            self._say(
                "the channels are polled one by one, which is less accurate than a buffer: a driver has a buffer if the"
                " INT wire is connected, or with a trigger"
            )
            self._read_channels()
        self._next_ns = self.now_ns()
        self._fruitless_ns = 0
        return self._decoder.sensor

    def poll(self) -> Samples:
        """Wait for the next poll, and return the samples since the last one; see `read`."""
        self.read()
        return self._decoder.take()

    def read(self) -> None:
        """Wait for the next poll, and read the samples since the last one.

        Raises
        ------
        BusError : a device is gone, or did not answer for two seconds. ChipError : its buffer stayed empty for so long.
        """
        begun_ns = self.now_ns()
        period_ns = round((self._config.period_s if self.buffered else 1 / self._config.rate_hz) * 1e9)
        self._next_ns = max(self._next_ns + period_ns, begun_ns)
        self._files.sleep_until(self._next_ns)
        trouble: BusError | None = None
        try:
            if self.buffered:
                for each in self._each:
                    each.read_frames()
            else:
                self._read_channels()
        except NoAnswer:
            raise
        except BusError as error:
            trouble = error
        self._fruitless_ns = 0 if self._decoder.has_new else self._fruitless_ns + self.now_ns() - begun_ns
        if self._fruitless_ns > DEAD_NS:
            raise trouble or ChipError(
                f"the buffer of {' and '.join(self._devices.each)} stays empty", NO_INTERRUPT_HINT
            )

    def recording(self) -> Recording:
        """Return all samples."""
        return self._decoder.recording()

    def forget(self) -> None:
        """Forget all samples."""
        self._decoder.forget()

    def stop(self) -> None:
        """Stop the buffers, and restore the attributes."""
        if self._decoder.gaps:
            self._say(f"samples are missing in {self._decoder.gaps} places: {Loss.KERNEL.what}; {Loss.KERNEL.remedy}")
        self._restore()

    def _restore(self) -> None:
        for each in self._each:
            with suppress(BusError, EndOfCapture):
                each.restore()

    def _read_channels(self) -> None:
        for each in self._each:
            for kind in each.kinds:
                for axis in AXES:
                    each.read(f"{kind}_{axis}_raw")
        first = self._each[0]
        # the die's temperature changes slowly
        if f"{TEMP}_raw" in first.names and self.now_ns() - self._warm_ns > S:
            self._warm_ns = self.now_ns()
            first.read(f"{TEMP}_raw")
