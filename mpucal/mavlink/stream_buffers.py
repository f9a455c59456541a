"""Buffers of a vehicle's IMU streams, and the recording of each IMU that a segment of them gives."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..clocks import MS, US
from ..clocks.device_clocks import VehicleClock
from ..data import Autopilot, Recording, Samples, Sensor, Vector
from .firmwares import ARDUPILOT, accel_lag_s, preferred_messages
from .imu import ACC_LSB_MPS2, GYRO_LSB_RAD_S, SCALED, Reading, Stream

MS_US = MS // US

# Single lost packets only lower the rate; a longer time without one is a gap.
GAP_S, GAP_INTERVALS = 0.08, 6.0
# A preferred stream is taken if it has at least this share of the packets of the IMU's busiest one.
MIN_SHARE = 0.5
# Times in ms are refined by those in us if at least this share of the packets has a partner.
MIN_PAIRED = 0.9

# Errors that are left on a replay of known truth: times are those of sending, up to a loop after the sample, and
# truncation is not white noise while the board turns slowly.
TRUNCATION_NOISE = (1.75 * ACC_LSB_MPS2 / math.sqrt(12.0), 3.5 * GYRO_LSB_RAD_S / math.sqrt(12.0))

# ArduPilot's times are those of sending. On its own simulator, whose motion is known to the step, samples were up to
# 0.4 ms earlier or later than their times, 0.2 ms rms, alike for 0.3 s; the claims hold with this.
SENT_LATE_S = 0.2e-3

# Numbers of a reading: acceleration, rate, temperature.
NUMBERS = 7


class Row(NamedTuple):
    """A reading with its time on the stream's unwrapped clock."""

    t_us: int
    reading: Reading


class StreamBuffer:
    """Readings of one stream, 64 bytes each."""

    def __init__(self, stream: Stream, clock: VehicleClock | None = None) -> None:
        self.stream = stream
        self.clock = clock or VehicleClock(stream.unit_us)
        self._times_us, self._numbers = array("q"), array("d")
        self._in_order = 0

    def __len__(self) -> int:
        """Return the number of readings that came in order."""
        return self._in_order

    def add(self, row: Row, late: bool) -> None:
        """Keep a reading."""
        self._times_us.append(row.t_us)
        self._numbers.extend(_numbers(row.reading))
        self._in_order += not late

    def extend(self, times_us: Vector, numbers: Vector) -> None:
        """Keep (n,) times and (n, NUMBERS) as `rows` returns them."""
        self._times_us.extend(times_us.astype(np.int64).tolist())
        self._numbers.extend(numbers.ravel().tolist())
        self._in_order += len(times_us)

    def rows(self) -> tuple[Vector, Vector]:
        """Return (n,) us, increasing, and (n, NUMBERS): acceleration, rate, temperature."""
        # Of two readings of one time the first is kept: the other is the same packet once more.
        times_us, first = np.unique(np.array(self._times_us, np.int64), return_index=True)
        return times_us.astype(np.float64), np.array(self._numbers).reshape(-1, NUMBERS)[first]


def samples_of(rows: Sequence[Row], before_us: float | None) -> Samples:
    """Return rows in their order as samples; `before_us` is the time of the sample before the first, if any."""
    numbers = np.array([_numbers(row.reading) for row in rows]).reshape(-1, NUMBERS)
    return _samples(numbers, np.array([row.t_us for row in rows], np.float64), before_us)


def _numbers(reading: Reading) -> tuple[float, ...]:
    return (*reading.acc, *reading.gyr, reading.temperature_c)


def _samples(numbers: Vector, t_us: Vector, before_us: float | None = None) -> Samples:
    """Return samples of (n, NUMBERS) at (n,) increasing times."""
    n = len(t_us)
    if not n:
        return Samples.empty()
    steps = np.diff(t_us, prepend=t_us[0] if before_us is None else before_us) / 1e6
    limit = GAP_S if n < 3 else max(GAP_S, GAP_INTERVALS * float(np.median(steps[1:])))
    no = np.zeros(n, bool)
    return Samples(
        t=t_us / 1e6,
        acc=numbers[:, :3],
        gyr=numbers[:, 3:6],
        temperature_c=numbers[:, 6],
        gap=steps > limit,
        acc_clipped=no,
        gyr_clipped=no.copy(),
    )


@dataclass
class Segment:
    """Streams of a vehicle under one set of parameters, between reboots; `rebooted`: they began with one."""

    parameters: dict[str, float]
    rebooted: bool = False
    streams: dict[Stream, StreamBuffer] = field(default_factory=dict)

    def __len__(self) -> int:
        return max(map(len, self.streams.values()), default=0)

    def of(self, stream: Stream) -> StreamBuffer:
        """Return the buffer of `stream`, an empty one if nothing came of it."""
        return self.streams.setdefault(stream, StreamBuffer(stream))

    def following(self, rebooted: bool = False) -> Segment:
        """Return an empty segment under the same parameters, with the same clocks."""
        streams = {stream: StreamBuffer(stream, buffer.clock) for stream, buffer in self.streams.items()}
        return Segment(dict(self.parameters), rebooted, streams)

    def recordings(self, firmware: str, name: str, first: Mapping[str, float]) -> list[Recording]:
        """Return one recording of each IMU in turn, by the best message of each; `first` : see Autopilot."""
        order, chosen = preferred_messages(firmware, self.parameters), []
        for imu in sorted({stream.imu for stream in self.streams}):
            known = [b for s, b in self.streams.items() if s.imu == imu and s.name in order]
            most = max(map(len, known), default=0)
            enough = [b for b in known if len(b) >= max(MIN_SHARE * most, 2)]
            chosen += [min(enough, key=lambda b: order.index(b.stream.name))] if enough else []
        exact_us = next((b.rows()[0] for b in chosen if b.stream.name not in SCALED), None)
        made = []
        for buffer in chosen:
            autopilot = Autopilot(firmware, buffer.stream.imu, buffer.stream.name, self.parameters, first)
            made.append(_recording(buffer, exact_us, autopilot, name))
        return made


def sensor_of(stream: Stream, firmware: str, parameters: Mapping[str, float], rate_hz: float) -> Sensor:
    """Return the sensor behind a vehicle's stream, without its temperature."""
    return Sensor(
        chip=f"{firmware}-IMU{stream.imu}",
        rate_hz=rate_hz,
        message=stream.name,
        least_noise=TRUNCATION_NOISE if stream.is_truncated else (0.0, 0.0),
        steps=(ACC_LSB_MPS2, GYRO_LSB_RAD_S) if stream.is_truncated else (0.0, 0.0),
        accel_lag_s=accel_lag_s(parameters),
        time_std=SENT_LATE_S if firmware == ARDUPILOT else 0.0,
    )


def _recording(buffer: StreamBuffer, exact_us: Vector | None, autopilot: Autopilot, name: str) -> Recording:
    stream = buffer.stream
    times_us, numbers = buffer.rows()
    if exact_us is not None and stream.name in SCALED:
        times_us = _refine(times_us, exact_us)
    samples = _samples(numbers, times_us)
    known = samples.temperature_c[np.isfinite(samples.temperature_c)]
    rate_hz = float((len(samples) - 1) / (samples.t[-1] - samples.t[0]))
    sensor = replace(
        sensor_of(stream, autopilot.firmware, autopilot.parameters, rate_hz),
        temperature_c=float(known.mean()) if len(known) else None,
    )
    return Recording(**vars(samples), sensor=sensor, name=name, autopilot=autopilot)


def _refine(times_us: Vector, exact_us: Vector) -> Vector:
    """Return (n,) us for times in whole ms, by the messages sent in the same ms; the same times if few were."""
    at = np.minimum(np.searchsorted(exact_us, times_us), len(exact_us) - 1)
    paired = (exact_us[at] >= times_us) & (exact_us[at] < times_us + MS_US)
    if paired.mean() < MIN_PAIRED:
        return times_us
    finer = np.where(paired, exact_us[at], times_us + MS_US / 2)
    return finer if (np.diff(finer) > 0).all() else times_us
