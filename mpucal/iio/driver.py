"""The samples of IIO devices as a session's source: from their buffers, or polled where there are none.

What it accesses depends on nothing but the replies and their times, so that a replay asks for the same accesses.
IIO_VERSION changes with every change of them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from ..chip.access import Files
from ..chip.config import Config
from ..data import Recording, Samples, Sensor
from ..errors import BusError, ChipError, EndOfCapture, NoAnswer
from .attributes import ACCEL, AXES, GYRO, TEMP
from .decode import IioDecoder
from .devices import Devices
from .setup import DeviceAttributes, set_up

# so long without a sample, and the driver gives up
DEAD_NS = 2_000_000_000
# what one read takes from a buffer at most
READ_BYTES = 65536
# the die's temperature changes slowly
TEMPERATURE_NS = 1_000_000_000

REGISTER_0 = (
    "it waits for interrupts that do not come: check the chip's INT wire and its line in the device tree; of an"
    " MPU-6050 the driver of Linux 6.1 takes register 0 for the interrupt's status, and gives no sample while its bit 0"
    " is 0: give --trigger none, which polls, or unbind the driver and give --bus"
)


class IioDriver:
    """The accelerometer and the gyroscope of one or two IIO devices.

    Parameters
    ----------
    files : of the kernel. devices : which ones. config : its rate and ranges are asked for.
    name : what to call the recording. say : is told what a person should know; one sentence, no full stop.
    trigger : of the buffers; None: their own. POLLED: none, the channels are polled.
    """

    def __init__(
        self,
        files: Files,
        devices: Devices,
        config: Config,
        name: str = "recording",
        say: Callable[[str], None] = lambda _sentence: None,
        trigger: str | None = None,
    ) -> None:
        self._files, self._devices, self._config, self._say, self._trigger = files, devices, config, say, trigger
        self._decoder = IioDecoder(name)
        self._each: list[DeviceAttributes] = []
        self._buffered = False
        self._now_ns = self._next_ns = self._fruitless_ns = self._warm_ns = 0

    def now_ns(self) -> int:
        """The host's monotonic clock as last seen."""
        return max([self._now_ns, *(each.now_ns for each in self._each)])

    @property
    def buffered(self) -> bool:
        """Whether samples come from buffers; once it was started."""
        return self._buffered

    def texts(self, device: str) -> dict[str, str]:
        """The attributes of a device as they were read last."""
        return dict(self._decoder.texts(device))

    def start(self) -> Sensor:
        """Look at the devices, set rate and ranges, and begin to measure.

        Raises
        ------
        BusError : no such device, or it cannot be written. ChipError : it has no such sensor, or no trigger.
        """
        self._now_ns = self.now_ns()
        self._each = [DeviceAttributes(self._files, self._decoder, device) for device in self._devices.each]
        for each in self._each:
            each.look(self._kinds(each.device))
        running = []
        try:
            for each in self._each:
                running.append(set_up(each, self._kinds(each.device), self._config, self._decoder, self._trigger))
        except (BusError, ChipError):
            self._restore()
            raise
        if any(running) and not all(running):
            self._restore()
            raise ChipError("one of the two devices has no buffer", "give --trigger none, which polls both")
        self._buffered = all(running)
        if not self._buffered:
            self._say(
                "the channels are polled one after the other, which is less exact than a buffer: a driver has one where"
                " the INT wire is connected, or with a trigger"
            )
            self._read_channels()
        self._next_ns = self.now_ns()
        self._fruitless_ns = 0
        return self._decoder.sensor

    def poll(self) -> Samples:
        """Wait for the next poll, and give the samples since the last.

        Raises
        ------
        BusError : a device is gone, or did not answer for two seconds. ChipError : its buffer stayed empty so long.
        """
        begun_ns = self.now_ns()
        period_ns = round((self._config.period_s if self._buffered else 1 / self._config.rate_hz) * 1e9)
        self._next_ns = max(self._next_ns + period_ns, begun_ns)
        self._sleep_until(self._next_ns)
        trouble: BusError | None = None
        try:
            if self._buffered:
                for each in self._each:
                    each.frames(READ_BYTES)
            else:
                self._read_channels()
        except NoAnswer:
            raise
        except BusError as error:
            trouble = error
        samples = self._decoder.take()
        self._fruitless_ns = 0 if len(samples) else self._fruitless_ns + self.now_ns() - begun_ns
        if self._fruitless_ns > DEAD_NS:
            raise trouble or ChipError(f"the buffer of {' and '.join(self._devices.each)} stays empty", REGISTER_0)
        return samples

    def recording(self) -> Recording:
        """Everything so far."""
        return self._decoder.recording()

    def forget(self) -> None:
        """Let go of all samples so far."""
        self._decoder.forget()

    def stop(self) -> None:
        """End the buffers, and write back what stood in the attributes before."""
        if self._decoder.gaps:
            self._say(
                f"samples are missing in {self._decoder.gaps} places: the kernel's buffer overran, or the trigger fired"
                " late; a lower --rate helps"
            )
        self._restore()

    def _restore(self) -> None:
        for each in self._each:
            with suppress(BusError, EndOfCapture):
                each.restore()

    def _kinds(self, device: str) -> tuple[str, ...]:
        return tuple(kind for kind, of in zip((ACCEL, GYRO), self._devices, strict=True) if of == device)

    def _read_channels(self) -> None:
        for each in self._each:
            for kind in self._kinds(each.device):
                for axis in AXES:
                    each.read(f"{kind}_{axis}_raw")
        first = self._each[0]
        if f"{TEMP}_raw" in first.names and self.now_ns() - self._warm_ns > TEMPERATURE_NS:
            self._warm_ns = self.now_ns()
            first.read(f"{TEMP}_raw")

    def _sleep_until(self, t_ns: int) -> None:
        self._files.sleep_until(t_ns)
        self._now_ns = max(self._now_ns, t_ns)
