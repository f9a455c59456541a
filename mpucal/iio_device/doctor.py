"""Examination of a sensor with a Linux kernel (IIO) driver: its attributes and its samples."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

from ..chip.families import PARTS
from ..chip.losses import Loss
from ..doctor.finding import Finding, Mark
from ..doctor.measure import examine_stream
from ..errors import SourceError
from ..iio.attributes import ACCEL, GYRO
from ..iio.decode import ENABLE
from ..iio.setup import POLLED, TRIGGER
from ..session.ports import measured
from .source import OpenedIio

# Time until a buffer runs steadily, and the board is put down.
SETTLED_S = 3.0
NO_BUFFER = "connect the chip's INT wire and name it in the device tree; without it the channels are polled"


def examine_iio(source: OpenedIio, seconds: float) -> Iterator[Finding]:
    """Examine the attributes of one or two devices, then `seconds` of their samples; the board is to lie still."""
    driver = source.driver(source.bus, "doctor", lambda _sentence: None)
    with closing(source.bus):
        try:
            sensor = driver.start()
        except SourceError as error:
            yield Finding.failed("kernel driver", error)
            return
        for device in source.devices.each:
            yield from _device(device, driver.texts(device), source.trigger)
        ranges = f"±{sensor.accel_range_g or 0:g} g, ±{sensor.gyro_range_dps or 0:g} deg/s"
        yield Finding("ranges", Mark.OK, ranges if sensor.accel_range_g else "unknown: the driver does not state them")
        try:
            measured(driver, SETTLED_S)
            driver.forget()
            recording = measured(driver, seconds)
        except SourceError as error:
            yield Finding.failed("stream", error)
            return
        finally:
            driver.stop()
    rate_hz = sensor.rate_hz or source.plan.config.rate_hz
    if len(recording) > rate_hz / 2:
        part = PARTS.get(sensor.who_am_i or 0)
        # Polled channels have no rate of their own.
        nominal_hz = rate_hz if driver.buffered else recording.rate_hz
        # The driver's time stamps are those of its interrupts: the whole is uncertain by half an interval at each end.
        recording = replace(recording, sensor=replace(recording.sensor, clock_std=0.5 / len(recording)))
        family = None if part is None else part.family
        yield from examine_stream(recording, nominal_hz, seconds, family, Loss.KERNEL.remedy)
    else:
        what = f"{len(recording)} samples in {seconds:g} s"
        yield Finding("stream", Mark.BAD, what, "look in `dmesg` for the driver and its interrupts")


def _device(device: str, texts: dict[str, str], trigger: str | None) -> Iterator[Finding]:
    matrix = next((texts[name] for name in texts if name.endswith("mount_matrix")), None)
    scales = ", ".join(f"{kind}_scale {texts[f'{kind}_scale']}" for kind in (ACCEL, GYRO) if f"{kind}_scale" in texts)
    what = f"{texts.get('name', 'unnamed')}; {scales}; mount matrix {matrix or 'not given'}"
    yield Finding(device, Mark.OK, what, "", {name: text for name, text in texts.items() if name})
    if trigger == POLLED:
        return
    has_buffer = ENABLE in texts
    what = f"of {device}, filled by {texts.get(TRIGGER) or 'the sensor'}" if has_buffer else f"{device} has none"
    yield Finding.check("buffer", has_buffer, what, NO_BUFFER, {})
