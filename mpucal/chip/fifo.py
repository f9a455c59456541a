"""FIFO bytes to samples: checks alignment and clipping, and gives each sample its time.

A frame is 14 bytes, big-endian int16: accelerometer x, y, z, temperature, gyroscope x, y, z in the order of its
family's row (RM-MPU-6000A r4.2, registers 59 to 72 and 116); of the accelerometer alone it is six. Those have no
temperature to be told by where they begin: there a part of a frame tells, since what slips is bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Mask, Recording, Samples, Sensor, Vector
from . import registers as reg
from .bit_flips import BitFlipFilter
from .clock import NS, SampleClock, Times, make_increasing
from .host_clock import HostClock
from .polled_clock import PolledClock
from .settings import Settings

Counts = NDArray[np.int16]
Whole = NDArray[np.int64]

FULL_SCALE_COUNT = 32767

# The die does not change by 1.2 C from one sample to the next; a misaligned frame shows another word here.
MAX_TEMPERATURE_STEP = 400
# The first frame after a reset may have been cut by it, and the filters are not settled.
DROPPED_FRAMES = 2
# Noise moves some of a frame's seven words: as many frames alike, over so long, are one that is repeated.
STUCK_FRAMES, STUCK_S = 10, 0.05
# Between two times that the regression would put in the wrong order, in sample intervals.
LEAST_STEP = 0.1


class FifoFault(StrEnum):
    """Why what lay in the FIFO is worth nothing."""

    OVERFLOW = "overflow"
    MISALIGNED = "misaligned"
    STUCK = "stuck"
    LATE = "late"
    LOST = "lost its settings"


@dataclass(frozen=True)
class Run:
    """Frames (n, 7 or 3) that follow each other, the first of them number `first` of `segment`."""

    segment: int
    first: int
    frames: Counts
    gap: bool


class FifoDecoder:
    """Turns what was read from the FIFO into samples; live and from a capture alike.

    A poll is `set_count`, then `data` if there was any, then `finish_poll` by the overflow flag: what was read is
    accepted only then, since the FIFO may have overflowed while it was read. `reset` whenever the FIFO was.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings, self._columns = settings, settings.columns
        clock = PolledClock if settings.polled else SampleClock
        self._clock: SampleClock | PolledClock = clock(settings.nominal_rate_hz)
        self._host = HostClock()
        self._runs: list[Run] = []
        self._taken = 0
        self._begun = False
        self._accepted = self._warmth = 0
        self._temperature: int | None = None
        self._read = 0
        self._look: tuple[int, int] | None = None
        self._odd_bytes = 0
        self._pending = bytearray()
        self._last_t_s: float | None = None
        self._stuck_frames = max(STUCK_FRAMES, math.ceil(STUCK_S * settings.nominal_rate_hz))
        self._alike = np.zeros((0, settings.frame_words), np.int16)
        self._flips = BitFlipFilter(settings.frame_words)

    @property
    def accepted(self) -> int:
        """How many frames were accepted."""
        return self._accepted

    @property
    def polled(self) -> bool:
        """Whether samples are read one by one; each is `set_count`, `data` and `finish_poll`."""
        return self._settings.polled

    @property
    def frame_words(self) -> int:
        """How many words a frame has."""
        return self._settings.frame_words

    @property
    def flipped(self) -> int:
        """How many words had a bit flipped on their way, and were set right."""
        return self._flips.found

    def set_temperature(self, count: int) -> None:
        """The temperature register shows `count`: what an aligned frame will show too."""
        self._temperature = count

    def add_clock_pair(self, t_ns: int, host_ns: int) -> None:
        """What was done at `t_ns` was heard of at `host_ns`, see Reply; by a reply that is like all others told of."""
        self._host.add(t_ns, host_ns)

    def add_clock_pairs(self, t_ns: Whole, host_ns: Whole) -> None:
        """The same of (n,) replies."""
        self._host.add_many(t_ns, host_ns)

    def set_count(self, t_ns: int, count_bytes: int) -> None:
        """The FIFO held `count_bytes` at `t_ns`."""
        frames, self._odd_bytes = divmod(count_bytes, self._settings.frame_bytes)
        self._pending.clear()
        self._look = (t_ns, self._read + frames)

    def add_bytes(self, data: bytes) -> None:
        """`data` was read from the FIFO."""
        self._pending += data

    def finish_poll(self, overflow: bool, lost: bool = False) -> FifoFault | None:
        """Believe what the poll read, or say why not; then only a reset helps.

        Frames at the end that are all alike wait until one that is not follows them.
        """
        data, look = bytes(self._pending), self._look
        self._pending.clear()
        self._look = None
        if lost:
            return FifoFault.LOST
        if overflow:
            return FifoFault.OVERFLOW
        if self._odd_bytes or len(data) % self._settings.frame_bytes:
            return FifoFault.MISALIGNED
        if look is not None and isinstance(self._clock, PolledClock) and self._clock.is_late(look[0]):
            return FifoFault.LATE
        frames = np.frombuffer(data, ">i2").reshape(-1, self._settings.frame_words).astype(np.int16)
        # frames that wait for others, all alike, have nothing flipped
        last = self._runs[-1].frames if self._runs and not len(self._alike) else self._alike
        kept = self._flips.repair(frames[max(DROPPED_FRAMES - self._read, 0) :], last)
        if not self._aligned(kept):
            return FifoFault.MISALIGNED
        self._read += len(frames)
        kept = np.concatenate((self._alike, kept))
        if self._stuck(kept):
            return FifoFault.STUCK
        if look is not None:
            self._clock.add(*look)
        self._accept(kept)
        return None

    def accept_plain_polls(self, looks_ns: Whole, frames: Counts, lengths: Whole) -> int:
        """How many of the next polls had nothing about them, and were accepted at once; the others are still to come.

        Of each poll, `looks_ns` (k,) when it counted what it read, `lengths` (k,) the frames of that, one at least, of
        all `frames` (n, words): the FIFO did not overflow.
        """
        if self._read <= DROPPED_FRAMES or len(self._alike) or self._odd_bytes:
            return 0
        ends = np.cumsum(lengths)
        odd = (frames[1:] == frames[:-1]).all(axis=1)
        if not self._settings.accel_only:
            warmth = frames[:, self._columns.temperature].astype(np.int64)
            before = warmth[0] if self._temperature is None else self._temperature
            odd = np.concatenate((odd, [False])) | (np.abs(np.diff(warmth, prepend=before)) > MAX_TEMPERATURE_STEP)
        plain = int(np.searchsorted(ends, np.argmax(odd), side="right")) if odd.any() else len(lengths)
        plain = self._flips.skip_clean(frames[: ends[plain - 1]], lengths[:plain]) if plain else 0
        if not plain:
            return 0
        kept = frames[: ends[plain - 1]]
        self._clock.add_many(looks_ns[:plain], self._read + ends[:plain])
        self._runs.append(Run(self._clock.segment, self._read, kept, gap=False))
        self._read += len(kept)
        self._accepted += len(kept)
        if not self._settings.accel_only:
            self._temperature = int(warmth[len(kept) - 1])
            self._warmth += int(warmth[: len(kept)].sum())
        return plain

    def _accept(self, kept: Counts) -> None:
        """Keep all but the run of frames alike at the end, which the next poll decides on."""
        differ = np.flatnonzero((kept[1:] != kept[:-1]).any(axis=1))
        alike = len(kept) - (int(differ[-1]) + 1 if len(differ) else 0)
        accepted = len(kept) - alike if alike > 1 else len(kept)
        self._alike = kept[accepted:]
        if accepted:
            first = self._read - len(kept)
            self._runs.append(Run(self._clock.segment, first, kept[:accepted], gap=self._gap_before(first)))
            self._begun = True
            self._accepted += accepted
            if not self._settings.accel_only:
                self._warmth += int(kept[:accepted, self._columns.temperature].sum(dtype=np.int64))

    def _stuck(self, kept: Counts) -> bool:
        """Whether a frame repeats itself for too long."""
        n = self._stuck_frames
        if len(kept) < n:
            return False
        same = (kept[1:] == kept[:-1]).all(axis=1)
        return bool((np.convolve(same, np.ones(n - 1, int), "valid") == n - 1).any())

    def reset(self) -> None:
        """The FIFO was emptied: what was in it is lost, and a frame begins at the next byte."""
        self._pending.clear()
        self._look = None
        self._alike = self._alike[:0]
        self._flips.forget()
        self._clock.begin_segment()
        self._read = self._odd_bytes = 0

    def take(self) -> Samples:
        """The samples since the last `take`; their times are what is known now, and increase."""
        runs, self._taken = self._runs[self._taken :], len(self._runs)
        if not runs:
            return Samples.empty()
        samples = self._after(self._last_t_s, self._samples(runs, self._provisional_s))
        self._last_t_s = float(samples.t[-1])
        return samples

    def release(self, last: bool = False) -> list[Run]:
        """The frames since the last time, let go of: `final` makes samples of them once there are no more.

        Without those of the `last` run, whose end may yet be set right by what follows.
        """
        runs, self._runs, self._taken = self._runs, [] if last else self._runs[-1:], 0
        return runs if last else runs[:-1]

    def final(self, runs: Iterable[Run]) -> Iterator[Samples]:
        """The samples of runs that were released, in the same order, with the best times there are."""
        times_s = self._final()
        last_t_s: float | None = None
        for run in runs:
            samples = self._after(last_t_s, self._samples([run], times_s))
            last_t_s = float(samples.t[-1])
            yield samples

    def forget(self) -> None:
        """Let go of all that was taken: `recording` holds what comes from now on."""
        self._runs, self._taken = self._runs[self._taken :], 0
        self._host.forget()
        if not self._runs:
            self._clock.forget()

    def recording(self, name: str) -> Recording:
        """All samples so far with the best times there are, and the sensor with its measured rate."""
        samples = self._samples(self._runs, self._final())
        arrays = {f.name: getattr(samples, f.name) for f in fields(Samples)}
        return Recording(**arrays, sensor=self.sensor, name=name)

    @property
    def sensor(self) -> Sensor:
        """The sensor; once there were samples, with its measured rate and mean temperature."""
        sensor = self._settings.sensor
        if not self._begun:
            return sensor
        sensor = replace(sensor, rate_hz=self._clock.rate_hz, temperature_c=self._mean_c)
        if not self._host:
            return sensor
        fit = self._host.fit()
        rate_hz = self._clock.rate_hz / (1.0 + fit.b)
        return replace(sensor, rate_hz=rate_hz, clock_ppm=fit.ppm, clock_std=fit.b_std)

    def provisional_ns(self, t_ns: int) -> int:
        """`t_ns` of the bus's clock as the samples that `take` gives show it."""
        return round(float(self._host.provisional_s(t_ns * NS)) / NS) if self._host else t_ns

    def _provisional_s(self, segment: NDArray[np.int64], index: NDArray[np.int64]) -> Vector:
        times_s = self._clock.times_s(segment, index)
        return np.asarray(self._host.provisional_s(times_s)) if self._host else times_s

    def _final(self) -> Times:
        times_s, host_s = self._clock.final(), self._host.final()
        return lambda segment, index: host_s(times_s(segment, index))

    def _aligned(self, frames: Counts) -> bool:
        if not len(frames) or self._settings.accel_only:
            return True
        temperature = frames[:, self._columns.temperature].astype(np.int64)
        before = temperature[0] if self._temperature is None else self._temperature
        if abs(temperature[0] - before) > MAX_TEMPERATURE_STEP:
            return False
        if (np.abs(temperature[1:] - temperature[:-1]) > MAX_TEMPERATURE_STEP).any():
            return False
        self._temperature = int(temperature[-1])
        return True

    def _gap_before(self, first: int) -> bool:
        return first == DROPPED_FRAMES and self._begun

    def _after(self, last_t_s: float | None, samples: Samples) -> Samples:
        """The same, each later than `last_t_s`."""
        if last_t_s is None:
            return samples
        t = make_increasing(np.concatenate(([last_t_s], samples.t)), LEAST_STEP / self._clock.rate_hz)[1:]
        return replace(samples, t=t)

    def _samples(self, runs: list[Run], times_s: Times) -> Samples:
        if not runs:
            return Samples.empty()
        frames = np.concatenate([run.frames for run in runs])
        settings, alone, n = self._settings, self._settings.accel_only, len(frames)
        gap = np.zeros(n, bool)
        gap[np.cumsum([0] + [len(run.frames) for run in runs[:-1]])] = [run.gap for run in runs]
        accel, gyro = frames[:, self._columns.accel], frames[:, self._columns.gyro]
        return Samples(
            t=self._times_s(runs, times_s),
            acc=accel * settings.mps2_per_lsb,
            gyr=np.full((n, 3), np.nan) if alone else gyro * reg.rad_s_per_lsb(settings.fs_sel),
            temperature_c=np.full(n, np.nan) if alone else self._celsius(frames[:, self._columns.temperature]),
            gap=gap,
            acc_clipped=_clipped(accel),
            gyr_clipped=np.zeros(n, bool) if alone else _clipped(gyro),
        )

    def _celsius(self, counts: Any) -> Any:
        family = self._settings.part.family
        return counts / family.lsb_per_c + family.zero_c

    @property
    def _mean_c(self) -> float | None:
        """Of all frames; where they hold no temperature, what its register showed last."""
        if self._settings.accel_only:
            return None if self._temperature is None else float(self._celsius(self._temperature))
        return float(self._celsius(self._warmth / self._accepted))

    def _times_s(self, runs: list[Run], times_s: Times) -> Vector:
        segment = np.concatenate([np.full(len(run.frames), run.segment) for run in runs])
        index = np.concatenate([np.arange(run.first, run.first + len(run.frames)) for run in runs])
        return make_increasing(times_s(segment, index), LEAST_STEP / self._clock.rate_hz)


def _clipped(counts: Counts) -> Mask:
    """(n,) True where one of (n, 3) stands at either end of int16."""
    at_end = np.abs(counts.astype(np.int32)) >= FULL_SCALE_COUNT
    return np.asarray(at_end.any(axis=1))
