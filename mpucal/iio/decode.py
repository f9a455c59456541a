"""Decoder of accesses to the files of IIO devices to samples, as they happen or from a capture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..chip.access import Transaction
from ..chip.families import part_named
from ..clocks.sample_clock import NS
from ..data import AXES, Recording, Samples, Sensor
from ..errors import ChipError, RecordingError
from .attributes import (
    ACCEL,
    GYRO,
    TEMP,
    TIMESTAMP,
    FrameLayout,
    ScanElement,
    SensorScale,
    chip_name,
    mount_matrix,
    parse_number,
    read_calibbias,
    read_number,
    read_scale,
)
from .sample_run import ROW, SampleRun

# A buffer with another clock than the host's monotonic one is off by more.
OTHER_CLOCK_NS = 5_000_000_000
LISTING = "/"
ENABLE, FREQUENCY = "buffer/enable", "sampling_frequency"


@dataclass
class _DeviceState:
    """State of a device: the texts of its attributes, and the layout of its frames."""

    texts: dict[str, str]
    layout: FrameLayout | None = None


class IioDecoder:
    """Decoder that knows the meaning of the buffers' bytes from the successful accesses alone.

    The driver feeds it its own accesses, and a reader those of a capture, so that both get the same samples.

    Parameters
    ----------
    name : of the recording.

    Attributes
    ----------
    gaps : number of places at which samples are missing. sensor : described by the attributes.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._devices: dict[str, _DeviceState] = {}
        self._scales: dict[str, tuple[str, SensorScale]] = {}
        self._run: SampleRun | None = None
        self._temperature = np.nan
        self.sensor = Sensor()
        self._samples: list[Samples] = []
        self._new: list[Samples] = []
        self.gaps = 0

    def feed(self, access: Transaction) -> None:
        """Take one access, which may have failed."""
        if access.error is not None:
            return
        device, _, name = access.register.partition("/")
        if not name and not access.register.endswith(LISTING):
            self._add_frames(device, access.data, access.t_ns)
            return
        held = self._devices.setdefault(device, _DeviceState({}))
        text = access.data.decode(errors="replace").strip()
        held.texts[name] = text
        if name == ENABLE and access.op == "write":
            held.layout = self._start_buffer(device) if text == "1" else None
        elif access.op == "read" and name.endswith("_raw"):
            self._add_count(name.removesuffix("_raw"), text, access.t_ns)

    def texts(self, device: str) -> dict[str, str]:
        """Return the attributes of a device that were read or written, by name."""
        return self._devices.setdefault(device, _DeviceState({})).texts

    def elements(self, device: str) -> dict[str, ScanElement]:
        """Return the channels that a device's frames may have, as far as they were read."""
        texts = self.texts(device)
        names = [name[len("scan_elements/") : -len("_type")] for name in texts if name.endswith("_type")]
        return {
            name: ScanElement.parse(name, texts[f"scan_elements/{name}_index"], texts[f"scan_elements/{name}_type"])
            for name in names
            if f"scan_elements/{name}_index" in texts
        }

    def scale(self, kind: str) -> tuple[str, SensorScale]:
        """Return the device and the scale of the accelerometer or the gyroscope.

        Raises
        ------
        RecordingError : no scale was read. ChipError : see attributes.read_scale.
        """
        if kind not in self._scales:
            device = next((d for d in self._devices if self._has(d, kind)), None)
            if device is None:
                raise RecordingError(f"{self._name} does not hold the scale of {kind}", "record again")
            self._scales[kind] = (device, read_scale(kind, device, self.texts(device), self.elements(device)))
        return self._scales[kind]

    def rate_hz(self, device: str) -> float | None:
        """Return the rate of a device; None if it has no such attribute."""
        names = (FREQUENCY, f"{ACCEL}_{FREQUENCY}", f"{GYRO}_{FREQUENCY}")
        rate_hz = read_number(self.texts(device), *names, default=0.0)
        return rate_hz if rate_hz > 0 else None

    @property
    def has_new(self) -> bool:
        """True if there are samples since the last `take`."""
        return bool(self._new)

    def take(self) -> Samples:
        """Return the samples since the last `take`."""
        new, self._new = self._new, []
        return Samples.joined(new)

    def forget(self) -> None:
        """Forget all samples."""
        self._samples, self._new = [], []

    def recording(self) -> Recording:
        """Return all samples."""
        samples = Samples.joined(self._samples)
        sensor, warm_c = self.sensor, samples.temperature_c[np.isfinite(samples.temperature_c)]
        if len(samples) > 1:
            sensor = replace(sensor, rate_hz=(len(samples) - 1) / float(np.ptp(samples.t)))
        if len(warm_c):
            sensor = replace(sensor, temperature_c=float(warm_c.mean()))
        return Recording(**vars(samples), sensor=sensor, name=self._name)

    def _has(self, device: str, kind: str) -> bool:
        return any(name.startswith(f"{kind}_") and name.endswith("scale") for name in self.texts(device))

    def _describe_sensor(self) -> Sensor:
        """Describe the sensor by its present attributes."""
        device, accel = self.scale(ACCEL)
        texts = self.texts(device)
        part = part_named(texts.get("name"))
        return Sensor(
            chip=chip_name(texts),
            who_am_i=None if part is None else part.who_am_i,
            accel_range_g=accel.full_scale,
            gyro_range_dps=self.scale(GYRO)[1].full_scale,
            rate_hz=self.rate_hz(device),
            accel_offsets=read_calibbias(texts),
        )

    def _start_buffer(self, device: str) -> FrameLayout:
        """Start the streams of frames, one if a device has both sensors, else two, and return the device's layout."""
        devices = {kind: self.scale(kind)[0] for kind in (ACCEL, GYRO)}
        texts, channels = self.texts(device), self.elements(device)
        enabled = {name: each for name, each in channels.items() if texts.get(f"scan_elements/{name}_en") == "1"}
        needed = [f"{kind}_{axis}" for kind, of in devices.items() if of == device for axis in AXES]
        missing = {*needed, TIMESTAMP} - set(enabled)
        if missing:
            raise ChipError(
                f"the buffer of {device} has no {min(missing)}", "use --trigger none, which polls, and record again"
            )
        self._start({of: ROW // len(set(devices.values())) for of in devices.values()})
        return FrameLayout(enabled.values())

    def _start(self, widths: dict[str, int]) -> SampleRun:
        # The attributes apply from here on; at the end the driver restores the old ones.
        self._scales = {}
        self.sensor = self._describe_sensor()
        accel, gyro = (mount_matrix(self.texts(self.scale(kind)[0]), kind) for kind in (ACCEL, GYRO))
        turned = None if np.array_equal(accel, gyro) else np.asarray(np.linalg.solve(accel, gyro), np.float64)
        scales = self.scale(ACCEL)[1], self.scale(GYRO)[1]
        self._run = SampleRun(*scales, turned, widths, self.sensor.rate_hz, gap_next=bool(self._samples))
        return self._run

    def _add_frames(self, device: str, data: bytes, t_ns: int) -> None:
        held, run = self._devices.get(device), self._run
        if held is None or held.layout is None or run is None or device not in run.widths or not data:
            return
        columns = held.layout.columns(data)
        times = columns[TIMESTAMP]
        if run.offset_ns is None:
            off = t_ns - int(times[-1])
            # After a reboot the kernel's clock begins again; that of a resumed session goes on.
            again = bool(self._samples) and times[0] * NS <= self._samples[-1].t[-1]
            run.offset_ns = off if again or abs(off) > OTHER_CLOCK_NS else 0
        parts = []
        for kind in (ACCEL, GYRO):
            of, scales = self.scale(kind)
            if of == device:
                counts = np.stack([columns[f"{kind}_{axis}"] for axis in AXES], axis=1).astype(np.float64)
                parts += [counts, scales.clipped(counts)[:, None]]
        if TEMP in columns:
            self._set_temperature(device, float(columns[TEMP][-1]))
        run.add(device, times + run.offset_ns, np.concatenate(parts, axis=1))
        self._deliver(run)

    def _add_count(self, channel: str, text: str, t_ns: int) -> None:
        """Add a polled count of one channel, which has its own time."""
        if channel == TEMP:
            device = next(d for d in self._devices if f"{TEMP}_raw" in self.texts(d))
            self._set_temperature(device, parse_number(channel, text))
            return
        names = [f"{kind}_{axis}" for kind in (ACCEL, GYRO) for axis in AXES]
        if channel not in names:
            return
        run = self._run
        if run is None or channel not in run.widths:
            run = self._start(dict.fromkeys(names, 2))
        count = np.array([[parse_number(channel, text)]])
        mark = self.scale(channel[:-2])[1].clipped(count)[:, None]
        run.add(channel, np.array([t_ns]), np.hstack((count, mark)))
        if channel == names[-1]:
            self._deliver(run)

    def _deliver(self, run: SampleRun) -> None:
        samples = run.take(self._temperature)
        if len(samples):
            self.gaps += int(samples.gap.sum())
            self._samples.append(samples)
            self._new.append(samples)

    def _set_temperature(self, device: str, count: float) -> None:
        texts = self.texts(device)
        scale = read_number(texts, f"{TEMP}_scale", default=1.0)
        self._temperature = (count + read_number(texts, f"{TEMP}_offset", default=0.0)) * scale / 1000
