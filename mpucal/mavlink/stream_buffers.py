"""Gather the readings of a vehicle's IMUs, and make one recording of each IMU."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..data import Autopilot, Recording, Samples, Sensor, Vector
from .clock import Jump, VehicleClock
from .firmwares import accel_lag_s
from .imu import ACC_LSB_MPS2, GYRO_LSB_RAD_S, SCALED, Reading, Stream

US_PER_S = 1e6
MS_US = 1000

# Single lost packets are as good as a lower rate; a longer time without one is a gap.
GAP_S, GAP_INTERVALS = 0.08, 6.0
# a stream that is truer is taken where it has at least this share of the packets of the busiest
SHARE = 0.5
PAIRED = 0.9

# Times are those of sending, up to a loop after the sample, and truncation is no white noise while the board turns
# slowly: what that leaves on a replay of known truth.
WHOLE_NOISE = (1.75 * ACC_LSB_MPS2 / math.sqrt(12.0), 3.5 * GYRO_LSB_RAD_S / math.sqrt(12.0))


class Row(NamedTuple):
    """One reading: t_us on the stream's line."""

    t_us: int
    reading: Reading


# of a reading: acceleration, rate, temperature
NUMBERS = 7


class StreamBuffer:
    """What one stream delivered: 64 bytes a reading."""

    def __init__(self, stream: Stream, clock: VehicleClock | None = None) -> None:
        self.stream = stream
        self.clock = clock or VehicleClock(stream.unit_us)
        self._times_us, self._numbers = array("q"), array("d")
        self._in_order = 0
        self._newest_us: int | None = None

    def __len__(self) -> int:
        """How many came in their order."""
        return self._in_order

    def add(self, reading: Reading, received_ns: int) -> tuple[Row | None, Jump]:
        """Keep a reading; the row where it is newer than all before it, and what the clock did before it."""
        t_us, jump = self.clock.unwrap(reading.time, received_ns)
        return self.keep(t_us, reading), jump

    def keep(self, t_us: int, reading: Reading) -> Row | None:
        """Keep a reading of that time; the row where it is newer than all before it."""
        self._times_us.append(t_us)
        self._numbers.extend(_numbers(reading))
        if self._newest_us is not None and t_us <= self._newest_us:
            return None
        self._newest_us = t_us
        self._in_order += 1
        return Row(t_us, reading)

    def extend(self, times_us: Vector, numbers: Vector) -> None:
        """Keep (n,) times and (n, NUMBERS) as `rows` gives them."""
        self._times_us.extend(times_us.astype(np.int64).tolist())
        self._numbers.extend(numbers.ravel().tolist())
        self._in_order += len(times_us)

    def forget(self) -> None:
        """Let go of all that was kept."""
        del self._times_us[:], self._numbers[:]
        self._in_order = 0

    def times_us(self) -> Vector:
        """(n,) us, increasing."""
        return np.unique(self._times_us).astype(np.float64)

    def samples(self, t_us: Vector | None = None) -> Samples:
        """All readings in the order of their times, or of those given instead."""
        times_us, numbers = self.rows()
        return _samples(numbers, times_us if t_us is None else t_us)

    def rows(self) -> tuple[Vector, Vector]:
        """(n,) us, increasing, and (n, NUMBERS): acceleration, rate, temperature."""
        # of two readings of one time the first is kept: the other is the same packet once more
        times_us, first = np.unique(np.array(self._times_us, np.int64), return_index=True)
        return times_us.astype(np.float64), np.array(self._numbers).reshape(-1, NUMBERS)[first]


def samples_of(rows: Sequence[Row], before_us: float | None) -> Samples:
    """Rows in their order as samples; `before_us` is the time of the sample before the first, where there was one."""
    numbers = np.array([_numbers(row.reading) for row in rows]).reshape(-1, NUMBERS)
    return _samples(numbers, np.array([row.t_us for row in rows], np.float64), before_us)


def _numbers(reading: Reading) -> tuple[float, ...]:
    return (*reading.acc, *reading.gyr, reading.temperature_c)


def _samples(numbers: Vector, t_us: Vector, before_us: float | None = None) -> Samples:
    """Samples of (n, NUMBERS) at (n,) increasing times."""
    n = len(t_us)
    if not n:
        return Samples.empty()
    steps = np.diff(t_us, prepend=t_us[0] if before_us is None else before_us) / US_PER_S
    limit = GAP_S if n < 3 else max(GAP_S, GAP_INTERVALS * float(np.median(steps[1:])))
    no = np.zeros(n, bool)
    return Samples(
        t=t_us / US_PER_S,
        acc=numbers[:, :3],
        gyr=numbers[:, 3:6],
        temperature_c=numbers[:, 6],
        gap=steps > limit,
        acc_clipped=no,
        gyr_clipped=no.copy(),
    )


class StreamBuffers:
    """All streams of a vehicle."""

    def __init__(self) -> None:
        self.streams: dict[Stream, StreamBuffer] = {}

    def add(self, reading: Reading, received_ns: int) -> tuple[Row | None, Jump]:
        """See StreamBuffer.add."""
        return self.of(reading.stream).add(reading, received_ns)

    def of(self, stream: Stream) -> StreamBuffer:
        """What `stream` delivered."""
        return self.streams.setdefault(stream, StreamBuffer(stream))

    def extend(self, stream: Stream, times_us: Vector, numbers: Vector) -> None:
        """See StreamBuffer.extend."""
        self.streams.setdefault(stream, StreamBuffer(stream)).extend(times_us, numbers)

    def following(self) -> StreamBuffers:
        """An empty one, whose clocks go on."""
        after = StreamBuffers()
        after.streams = {stream: StreamBuffer(stream, buffer.clock) for stream, buffer in self.streams.items()}
        return after

    def forget(self) -> None:
        """Let go of all that was kept."""
        for buffer in self.streams.values():
            buffer.forget()

    def chosen(self, order: Sequence[str]) -> list[StreamBuffer]:
        """The stream of each IMU to believe, by IMU.

        Parameters
        ----------
        order : the message names that tell the truth, the truest first.
        """
        found = []
        for imu in sorted({stream.imu for stream in self.streams}):
            known = [g for s, g in self.streams.items() if s.imu == imu and s.name in order]
            most = max((len(g) for g in known), default=0)
            enough = [g for g in known if len(g) >= max(SHARE * most, 2)]
            found += [min(enough, key=lambda g: order.index(g.stream.name))] if enough else []
        return found

    def recordings(
        self, order: Sequence[str], name: str, firmware: str, parameters: Mapping[str, float]
    ) -> list[Recording]:
        """One recording an IMU, the first IMU's first; see `chosen`."""
        chosen = self.chosen(order)
        fine = next((g for g in chosen if g.stream.name not in SCALED), None)
        made = []
        for buffer in chosen:
            autopilot = Autopilot(firmware, buffer.stream.imu, buffer.stream.name, parameters)
            made.append(_recording(buffer, fine, autopilot, name))
        return made


def _recording(buffer: StreamBuffer, fine: StreamBuffer | None, autopilot: Autopilot, name: str) -> Recording:
    samples = buffer.samples(None if fine is None else _finer(buffer, fine))
    known = samples.temperature_c[np.isfinite(samples.temperature_c)]
    stream = buffer.stream
    sensor = Sensor(
        chip=chip(autopilot.firmware, stream.imu),
        rate_hz=float((len(samples) - 1) / (samples.t[-1] - samples.t[0])),
        temperature_c=float(known.mean()) if len(known) else None,
        message=stream.name,
        least_noise=least_noise(stream),
        steps=steps(stream),
        accel_lag_s=accel_lag_s(autopilot.parameters),
    )
    columns = {key: getattr(samples, key) for key in Samples.__dataclass_fields__}
    return Recording(**columns, sensor=sensor, name=name, autopilot=autopilot)


def _finer(buffer: StreamBuffer, fine: StreamBuffer) -> Vector | None:
    """(n,) us in place of whole ms, of the messages that were sent in the same millisecond; None where few were."""
    if buffer.stream.name not in SCALED:
        return None
    times, exact = buffer.times_us(), fine.times_us()
    at = np.minimum(np.searchsorted(exact, times), len(exact) - 1)
    paired = (exact[at] >= times) & (exact[at] < times + MS_US)
    if paired.mean() < PAIRED:
        return None
    finer = np.where(paired, exact[at], times + MS_US / 2)
    return finer if (np.diff(finer) > 0).all() else None


def least_noise(stream: Stream) -> tuple[float, float]:
    """m/s^2, rad/s that a sample of a stream has at least, however still it reads."""
    return WHOLE_NOISE if stream.is_truncated else (0.0, 0.0)


def steps(stream: Stream) -> tuple[float, float]:
    """m/s^2, rad/s that a stream's numbers are whole multiples of; 0 for floats."""
    return (ACC_LSB_MPS2, GYRO_LSB_RAD_S) if stream.is_truncated else (0.0, 0.0)


def chip(firmware: str, imu: int) -> str:
    """What to call the sensor behind a vehicle's stream."""
    return f"{firmware}-IMU{imu}"
