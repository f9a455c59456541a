"""FIFO decoder: checks the frames' alignment, marks clipped samples, and gives each sample its time.

A frame is 14 bytes, big-endian int16: accelerometer x, y, z, temperature, gyroscope x, y, z (RM-MPU-6000A r4.2,
registers 59 to 72 and 116).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from ..clocks.host_clock import HostClock
from ..clocks.sample_clock import NS, PolledClock, SampleClock, Times, make_increasing
from ..data import Mask, Recording, Samples, Sensor, Vector, Whole
from . import registers as reg
from .bit_flips import BitFlipFilter, Counts
from .config import Settings
from .losses import Loss

FULL_SCALE_COUNT = int(np.iinfo(np.int16).max)
# columns of a frame
ACCEL, TEMPERATURE, GYRO = slice(0, 3), 3, slice(4, 7)

# The die does not change by 1.2 C from one sample to the next; a misaligned frame shows another word here.
MAX_TEMPERATURE_STEP = 400
# The first frame after a reset may have been cut by it, and the filters are not settled.
DROPPED_FRAMES = 2
# Noise changes some of a frame's seven words from one frame to the next. So if this many frames, over this time, are
# equal, the chip repeats one.
STUCK_FRAMES, STUCK_S = 10, 0.05
# Least step between two sample times, in sample intervals: the regression of the clock may put them in wrong order.
LEAST_STEP = 0.1


class Run(NamedTuple):
    """Consecutive frames (n, 7) from number `first` of `segment` on; `gap`: samples are missing before them."""

    segment: int
    first: int
    frames: Counts
    gap: bool


class FifoDecoder:
    """Decoder of the bytes of the FIFO to samples, live or from a capture.

    Call `set_count` for each poll, then `add_bytes` if there were any, then `finish_poll` with the overflow flag. The
    bytes are accepted only then, since the FIFO may have overflowed while it was read. Call `reset` after each reset of
    the FIFO.

    Attributes
    ----------
    settings : of the chip. accepted : number of accepted frames.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self._clock = (PolledClock if settings.polled else SampleClock)(settings.nominal_rate_hz)
        self._host = HostClock()
        self._runs: list[Run] = []
        self._taken = 0
        self._begun = False
        self.accepted = self._temperature_sum = 0
        self._temperature: int | None = None
        self._read = 0
        self._counted: tuple[int, int] | None = None
        self._odd_bytes = 0
        self._pending = bytearray()
        self._last_t_s: float | None = None
        self._stuck_frames = max(STUCK_FRAMES, math.ceil(STUCK_S * settings.nominal_rate_hz))
        self._waiting = np.zeros((0, reg.FRAME_WORDS), np.int16)
        self._flips = BitFlipFilter(reg.FRAME_WORDS)

    @property
    def repaired(self) -> int:
        """Number of words in which a bit flipped on the bus was repaired."""
        return self._flips.repaired

    def set_temperature(self, count: int) -> None:
        """Set the count of the temperature register, with which the first frame is compared to see its alignment."""
        self._temperature = count

    def add_clock_pairs(self, t_ns: Whole, host_ns: Whole) -> None:
        """Record (bus time, host arrival time) pairs (n,) for the fit of the bus's clock; see Reply."""
        self._host.add(t_ns, host_ns)

    def set_count(self, t_ns: int, count_bytes: int) -> None:
        """Begin a poll: the FIFO held `count_bytes` at `t_ns`."""
        frames, self._odd_bytes = divmod(count_bytes, reg.FRAME_BYTES)
        self._pending.clear()
        self._counted = (t_ns, self._read + frames)

    def add_bytes(self, data: bytes) -> None:
        """Add bytes that were read from the FIFO."""
        self._pending += data

    def finish_poll(self, overflow: bool, lost: bool = False) -> Loss | None:
        """Accept what the poll read, or return why not; then the FIFO must be reset.

        Two kinds of frames at the end wait for the next poll: equal ones, in case the chip repeats itself, and a last
        one in which a bit may be flipped. `lost`: the chip was reset meanwhile.
        """
        data, counted = bytes(self._pending), self._counted
        self._pending.clear()
        self._counted = None
        if lost:
            return Loss.RESET
        if overflow:
            return Loss.OVERFLOW
        if self._odd_bytes or len(data) % reg.FRAME_BYTES:
            return Loss.MISALIGNED
        if counted is not None and isinstance(self._clock, PolledClock) and self._clock.is_late(counted[0]):
            return Loss.LATE
        frames = np.frombuffer(data, ">i2").reshape(-1, reg.FRAME_WORDS).astype(np.int16)
        kept = self._flips.repair(frames[max(DROPPED_FRAMES - self._read, 0) :], self._waiting)
        if self._temperature_jumps(kept).any():
            return Loss.MISALIGNED
        self._read += len(frames)
        kept = np.concatenate((self._waiting, kept))
        longest, last = _equal_frames(kept)
        if longest >= self._stuck_frames:
            return Loss.STUCK
        if counted is not None:
            self._clock.add(*np.array([counted]).T)
        self._accept(kept, last)
        return None

    def accept_plain_polls(self, counted_ns: Whole, frames: Counts, lengths: Whole) -> int:
        """Accept leading polls that need no checks, and return their number; `finish_poll` takes the next one.

        The FIFO did not overflow in any of them.

        Parameters
        ----------
        counted_ns : (k,) when each poll counted the FIFO. lengths : (k,) frames of each, one at least.
        frames : (n, words) of all of them.
        """
        if self._read <= DROPPED_FRAMES or len(self._waiting) or self._odd_bytes:
            return 0
        ends = np.cumsum(lengths)
        odd = np.concatenate(((frames[1:] == frames[:-1]).all(axis=1), [False])) | self._temperature_jumps(frames)
        plain = int(np.searchsorted(ends, np.argmax(odd), side="right")) if odd.any() else len(lengths)
        plain = self._flips.skip_clean(frames[: ends[plain - 1]], lengths[:plain]) if plain else 0
        if not plain:
            return 0
        kept = frames[: ends[plain - 1]]
        self._clock.add(counted_ns[:plain], self._read + ends[:plain])
        self._read += len(kept)
        self._accept(kept, 1)
        return plain

    def _accept(self, kept: Counts, equal: int) -> None:
        """Keep the frames, except those at the end that wait for the next poll.

        These are the last `equal` ones if they are several, or else a last one in which a bit may be flipped.
        """
        if len(kept):
            self._temperature = int(kept[-1, TEMPERATURE])
        accepted = len(kept) - (equal if equal > 1 else min(int(self._flips.is_open), len(kept)))
        self._waiting = kept[accepted:].copy()
        if not accepted:
            return
        first = self._read - len(kept)
        self._runs.append(Run(self._clock.segment, first, kept[:accepted], first == DROPPED_FRAMES and self._begun))
        self._begun = True
        self.accepted += accepted
        self._temperature_sum += int(kept[:accepted, TEMPERATURE].sum(dtype=np.int64))

    def reset(self) -> None:
        """Discard what was in the FIFO, which was emptied: a frame begins at the next byte."""
        self._pending.clear()
        self._counted = None
        self._waiting = self._waiting[:0]
        self._flips.reset()
        self._clock.begin_segment()
        self._read = self._odd_bytes = 0

    def take(self) -> Samples:
        """Return the samples since the last call, with increasing provisional times."""
        runs, self._taken = self._runs[self._taken :], len(self._runs)
        if not runs:
            return Samples.empty()
        samples = self._move_after(self._last_t_s, self._samples(runs, self._provisional_times_s))
        self._last_t_s = float(samples.t[-1])
        return samples

    def release(self) -> list[Run]:
        """Return the frames since the last call, and forget them; `final` makes samples of them when all are read."""
        runs, self._runs, self._taken = self._runs, [], 0
        return runs

    def final(self, runs: Iterable[Run]) -> Iterator[Samples]:
        """Yield the samples of the runs that `release` returned, in the same order, with final times."""
        times_s = self._final_times()
        last_t_s: float | None = None
        for run in runs:
            samples = self._move_after(last_t_s, self._samples([run], times_s))
            last_t_s = float(samples.t[-1])
            yield samples

    def forget(self) -> None:
        """Forget all samples: `recording` holds those from now on."""
        self.release()
        self._host.forget()
        self._clock.forget()

    def recording(self, name: str) -> Recording:
        """Return all samples with final times, and the sensor with its measured rate."""
        samples = self._samples(self._runs, self._final_times())
        return Recording(**vars(samples), sensor=self.sensor, name=name)

    @property
    def sensor(self) -> Sensor:
        """Sensor with its measured rate and mean temperature, once there were samples."""
        sensor = self.settings.sensor
        if not self._begun:
            return sensor
        sensor = replace(sensor, rate_hz=self._clock.rate_hz, temperature_c=self._mean_c)
        if not self._host:
            return sensor
        fit = self._host.fit()
        rate_hz = self._clock.rate_hz / (1.0 + fit.b)
        return replace(sensor, rate_hz=rate_hz, clock_ppm=fit.ppm, clock_std=fit.b_std)

    def provisional_ns(self, t_ns: int) -> int:
        """Convert a time of the bus's clock to the provisional times of `take`."""
        return round(float(self._host.provisional_s(t_ns * NS)) / NS) if self._host else t_ns

    def _provisional_times_s(self, segment: Whole, index: Whole) -> Vector:
        times_s = self._clock.times_s(segment, index)
        return np.asarray(self._host.provisional_s(times_s)) if self._host else times_s

    def _final_times(self) -> Times:
        times_s, host_s = self._clock.final(), self._host.final()
        return lambda segment, index: host_s(times_s(segment, index))

    def _temperature_jumps(self, frames: Counts) -> Mask:
        """Return (n,) True where the temperature jumps: such a frame is not aligned."""
        if not len(frames):
            return np.zeros(0, bool)
        temperature = frames[:, TEMPERATURE].astype(np.int32)
        before = temperature[0] if self._temperature is None else self._temperature
        if max(temperature.max(), before) - min(temperature.min(), before) <= MAX_TEMPERATURE_STEP:
            return np.zeros(len(frames), bool)
        return np.asarray(np.abs(np.diff(temperature, prepend=before)) > MAX_TEMPERATURE_STEP)

    def _move_after(self, last_t_s: float | None, samples: Samples) -> Samples:
        """Return the samples with times that are later than `last_t_s` and increase, changed only if needed."""
        step_s = LEAST_STEP / self._clock.rate_hz
        if last_t_s is None or samples.t[0] - last_t_s >= step_s:
            return samples
        t = make_increasing(np.concatenate(([last_t_s], samples.t)), step_s)[1:]
        return replace(samples, t=t)

    def _samples(self, runs: list[Run], times_s: Times) -> Samples:
        if not runs:
            return Samples.empty()
        frames = np.concatenate([run.frames for run in runs])
        settings, n = self.settings, len(frames)
        gap = np.zeros(n, bool)
        gap[[*accumulate((len(run.frames) for run in runs[:-1]), initial=0)]] = [run.gap for run in runs]
        segment = np.concatenate([np.full(len(run.frames), run.segment) for run in runs])
        index = np.concatenate([np.arange(run.first, run.first + len(run.frames)) for run in runs])
        at_end = (frames >= FULL_SCALE_COUNT) | (frames <= -FULL_SCALE_COUNT)
        return Samples(
            t=make_increasing(times_s(segment, index), LEAST_STEP / self._clock.rate_hz),
            acc=frames[:, ACCEL] * settings.mps2_per_lsb,
            gyr=frames[:, GYRO] * reg.rad_s_per_lsb(settings.fs_sel),
            temperature_c=self._celsius(frames[:, TEMPERATURE]),
            gap=gap,
            acc_clipped=at_end[:, 0] | at_end[:, 1] | at_end[:, 2],
            gyr_clipped=at_end[:, 4] | at_end[:, 5] | at_end[:, 6],
        )

    def _celsius(self, counts: Any) -> Any:
        family = self.settings.part.family
        return counts / family.lsb_per_c + family.zero_c

    @property
    def _mean_c(self) -> float:
        """Mean temperature of all frames."""
        return float(self._celsius(self._temperature_sum / self.accepted))


def _equal_frames(frames: Counts) -> tuple[int, int]:
    """Return the length of the longest run of equal frames, and of the last one."""
    same = (frames[1:] == frames[:-1]).all(axis=1)
    if not same.any():
        return min(len(frames), 1), min(len(frames), 1)
    lengths = np.diff(np.flatnonzero(~same), prepend=-1, append=len(same))
    return int(lengths.max()), int(lengths[-1])
