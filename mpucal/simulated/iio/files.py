"""Files of a simulated IIO device: attributes as text, and a buffer that the simulated chip fills.

mpucal's own driver stands for the kernel's: its samples become frames like those of inv_mpu6050.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence

import numpy as np

from ...chip import registers as reg
from ...chip.access import Bus, Reply
from ...chip.config import Config
from ...chip.driver import Driver
from ...chip.families import PARTS, Part
from ...chip.offsets import OffsetRegisters, Words
from ...chip.port import Port
from ...chip.registers import ACCEL_RANGES_G, GYRO_RANGES_DPS
from ...chip.setup import read_identity
from ...data import AXES, Samples
from ...iio.attributes import ACCEL, GYRO, MPU_SCALES, PRINTED_SCALES, TEMP, TIMESTAMP, FrameLayout, ScanElement
from ...iio.setup import TRIGGERS
from ...iio_device.source import file_error
from ..chip import SimulatedBus, with_long_polls

RANGES = {ACCEL: ACCEL_RANGES_G, GYRO: GYRO_RANGES_DPS}
SETTINGS = ("buffer/enable", "sampling_frequency", *(f"{kind}_scale" for kind in RANGES))
CHANNELS = [f"{kind}_{axis}" for kind in (ACCEL, GYRO) for axis in AXES]
REGISTERS = {channel: reg.ACCEL_XOUT_H + 2 * i for i, channel in enumerate([*CHANNELS[:3], TEMP, *CHANNELS[3:]])}
IDENTITY = "1, 0, 0; 0, 1, 0; 0, 0, 1"


class SimulatedFiles(Bus):
    """Files of one device with both sensors, or of two with one each.

    Parameters
    ----------
    bus : to the chip. two_devices : one for each sensor, the accelerometer's first. buffered : they have buffers.
    """

    def __init__(self, bus: SimulatedBus, *, two_devices: bool = False, buffered: bool = True) -> None:
        self._bus = bus
        self._port = Port(bus)
        part = PARTS[read_identity(self._port)]
        self._place = part.family.accel_offset_h
        kinds = [[ACCEL], [GYRO]] if two_devices else [[ACCEL, GYRO]]
        self._devices = {f"iio:device{i}": _Device(each, part, buffered) for i, each in enumerate(kinds)}
        self._driver: Driver | None = None
        self._written: Words | None = None
        self._now_ns = 0

    def read(self, register: str, count: int) -> Reply:
        """See Bus."""
        if register == TRIGGERS:
            return Reply(b"hrtimer-0", self._now_ns)
        device, _, name = register.partition("/")
        held = self._device(device, name)
        if register.endswith("/"):
            return Reply("\n".join(sorted(held.texts)).encode(), self._now_ns)
        if not name:
            if not held.running:
                raise file_error(_error(errno.EINVAL), device)
            take = count - count % held.layout.frame_bytes
            data, held.frames = bytes(held.frames[:take]), held.frames[take:]
            return Reply(data, self._now_ns)
        if name.endswith("_raw"):
            return Reply(f"{self._read_channel(name.removesuffix('_raw'))}\n".encode(), self._now_ns)
        if name.endswith("_calibbias"):
            return Reply(f"{self._words()[AXES.index(name[-len('_calibbias') - 1])]}\n".encode(), self._now_ns)
        return Reply(f"{held.texts[name]}\n".encode(), self._now_ns)

    def write(self, register: str, data: bytes) -> int:
        """See Bus."""
        device, _, name = register.partition("/")
        held, text = self._device(device, name), data.decode()
        if held.running and name != "buffer/enable":
            raise file_error(_error(errno.EBUSY), device, name, text)
        if name.endswith("_calibbias"):
            x, y, z = (
                int(text) if name == f"{ACCEL}_{a}_calibbias" else w for a, w in zip(AXES, self._words(), strict=True)
            )
            self._written = (x, y, z)
            self._write_words(self._written)
            return self._now_ns
        held.texts[name] = text
        if name in SETTINGS:
            self._driver = None
        if name == "buffer/enable":
            held.begin()
        return self._now_ns

    def sleep_until(self, t_ns: int) -> None:
        """Wait while the chip fills the buffers."""
        while self._running and self._now_ns < t_ns:
            self._fill_buffers()
        self._bus.sleep_until(t_ns)
        self._now_ns = max(self._now_ns, t_ns)

    def close(self) -> None:
        """See Bus."""
        self._bus.close()

    @property
    def _running(self) -> bool:
        return any(device.running for device in self._devices.values())

    def _device(self, device: str, name: str) -> _Device:
        held = self._devices.get(device)
        if held is None or (name and name not in held.texts):
            raise file_error(_error(errno.ENOENT), device, name)
        return held

    def _fill_buffers(self) -> None:
        """Move the chip's new samples into the buffers."""
        driver = self._start_driver()
        samples = driver.poll()
        self._now_ns = max(self._now_ns, driver.now_ns())
        for device in self._devices.values():
            device.fill(samples)

    def _start_driver(self) -> Driver:
        """Return the driver that stands for the kernel's, started with the attributes' settings."""
        if self._driver is None:
            first = next(iter(self._devices.values()))
            ranges = {kind: device.range(kind) for device in self._devices.values() for kind in device.kinds}
            config = Config(ranges[ACCEL], ranges[GYRO], float(first.texts["sampling_frequency"]))
            polled = with_long_polls(config, self._bus.real_time)
            self._driver = Driver(self._bus, polled, "the simulated kernel")
            self._driver.start()
            if self._written is not None:
                # mpucal's driver resets the chip; the kernel's does not.
                self._write_words(self._written)
        return self._driver

    def _read_channel(self, channel: str) -> int:
        """Read the present count of one channel."""
        if self._running:
            raise file_error(_error(errno.EBUSY), "iio:device0", f"{channel}_raw")
        self._start_driver()
        reply = self._bus.read(REGISTERS[channel], 2)
        self._now_ns = max(self._now_ns, reply.t_ns)
        return int.from_bytes(reply.data, "big", signed=True)

    def _write_words(self, words: Words) -> None:
        OffsetRegisters.read(self._port, self._place).with_words(words).write(self._port)

    def _words(self) -> Words:
        return OffsetRegisters.read(self._port, self._place).words


class _Device:
    """Attributes of one device, and its buffer."""

    def __init__(self, kinds: Sequence[str], part: Part, buffered: bool) -> None:
        self.kinds = kinds
        # inv_mpu6050 has thousandths of a degree.
        self._temp_scale, self._temp_offset = 1000 / part.family.lsb_per_c, part.family.zero_c * part.family.lsb_per_c
        self.frames = b""
        self.texts = {"name": part.chip.replace("-", "").lower(), "in_mount_matrix": IDENTITY}
        self.texts |= {"sampling_frequency": "50", "sampling_frequency_available": "10 20 50 100 200 500"}
        for kind in kinds:
            scales = [f"{scale:.9f}" for scale in PRINTED_SCALES[kind]]
            self.texts |= {f"{kind}_scale": scales[0], f"{kind}_scale_available": " ".join(scales)}
            self.texts |= {f"{kind}_{axis}_raw": "" for axis in AXES}
        if ACCEL in kinds:
            self.texts |= {f"{ACCEL}_{axis}_calibbias": "" for axis in AXES}
            self.texts |= {f"{TEMP}_raw": "", f"{TEMP}_scale": f"{self._temp_scale:.6f}"}
            self.texts |= {f"{TEMP}_offset": f"{self._temp_offset:.0f}"}
        self._elements = {
            channel: ScanElement(channel, i, ">", True, 16, 2, 0)
            for i, channel in enumerate(
                [*(c for c in CHANNELS if c.startswith(tuple(kinds))), *([TEMP] if ACCEL in kinds else [])]
            )
        } | {TIMESTAMP: ScanElement(TIMESTAMP, 9, "<", True, 64, 8, 0)}
        if buffered:
            for channel, element in self._elements.items():
                stored = 8 * element.stored_bytes
                order = "be" if element.order == ">" else "le"
                self.texts[f"scan_elements/{channel}_type"] = f"{order}:s{element.bits}/{stored}>>{element.shift}"
                self.texts[f"scan_elements/{channel}_index"] = str(element.index)
                self.texts[f"scan_elements/{channel}_en"] = "0"
            self.texts |= {"buffer/enable": "0", "buffer/length": "2", "buffer/watermark": "1"}
            self.texts |= {"trigger/current_trigger": "hrtimer-0", "current_timestamp_clock": "realtime"}

    @property
    def running(self) -> bool:
        """True if the buffer is enabled."""
        return self.texts.get("buffer/enable") == "1"

    def range(self, kind: str) -> int:
        """Return the range in g or deg/s."""
        scale = float(self.texts[f"{kind}_scale"])
        return RANGES[kind][int(np.argmin(np.abs(np.array(PRINTED_SCALES[kind]) - scale)))]

    def begin(self) -> None:
        """Empty the buffer, which has just been enabled or disabled."""
        enabled = [e for e in self._elements.values() if self.texts.get(f"scan_elements/{e.name}_en") == "1"]
        self.layout = FrameLayout(enabled)
        self.frames = b""

    def columns(self, samples: Samples) -> dict[str, np.ndarray]:
        """Return (n,) counts of each channel."""
        temperature = samples.temperature_c * 1000 / self._temp_scale - self._temp_offset
        columns = {TIMESTAMP: np.round(samples.t * 1e9).astype(np.int64), TEMP: np.round(temperature)}
        for kind, values in ((ACCEL, samples.acc), (GYRO, samples.gyr)):
            if kind in self.kinds:
                counts = np.round(values / MPU_SCALES[kind][RANGES[kind].index(self.range(kind))])
                columns |= {f"{kind}_{axis}": counts[:, i] for i, axis in enumerate(AXES)}
        return columns

    def fill(self, samples: Samples) -> None:
        """Append samples to an enabled buffer; those beyond its length are lost."""
        if not self.running or len(samples) == 0:
            return
        columns = self.columns(samples)
        room = int(self.texts["buffer/length"]) - len(self.frames) // self.layout.frame_bytes
        self.frames += self.layout.packed(columns)[: max(room, 0) * self.layout.frame_bytes]


def _error(number: int) -> OSError:
    return OSError(number, os.strerror(number))
