"""Sums over a long rest, in constant memory: Allan variances, and disturbances: turns, steps of slow means, and tones.

The Allan variance is overlapping, over octaves of time:

    AVAR(tau) = mean of (mean over the next tau - mean over this tau)^2 / 2

(D. W. Allan, 1966; IEEE Std 952, annex C), at tau of 1, 2, 4, ... samples. Up to 16 samples every overlap is counted,
as in allantools' oadev; beyond, means over blocks of a 16th of tau are shifted by one block, which loses no measurable
information, and needs 32 numbers per octave.

The means are over blocks that double in length. The tones are lines of a power spectral density that is averaged over
segments (Welch, 1967).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Vector
from ..kernel import _kernel
from ..rests.limits import OF_NORMAL

# distances in samples; beyond the last, which many blocks make a tau
_FIRST = (1, 2, 4, 8, 16)


class _Level:
    """Level of blocks of one length: differences of their means at each distance, and means of pairs."""

    def __init__(self, axes: int, distances: tuple[int, ...]) -> None:
        self.distances = np.array(distances)
        self.sums = np.zeros((len(distances), axes))
        self.counts = np.zeros(len(distances))
        self._tail, self._is_odd = np.zeros((axes, 0)), False

    def interrupt(self) -> None:
        """Reset after a gap."""
        self._tail, self._is_odd = self._tail[:, :0], False

    def add(self, blocks: Vector) -> Vector:
        """Add block means (axes, n); return the means of pairs."""
        z, new = np.concatenate([self._tail, blocks], axis=1), blocks.shape[1]
        self.sums += _kernel.squared_differences(z, new, self.distances).T / self.distances[:, None] ** 2
        self.counts += np.minimum(np.maximum(z.shape[1] - 2 * self.distances + 1, 0), new)
        first = self._tail.shape[1] - self._is_odd
        self._is_odd = bool((z.shape[1] - first) % 2)
        self._tail = z[:, max(z.shape[1] - 2 * _FIRST[-1] + 1, 0) :].copy()
        last = z.shape[1] - self._is_odd
        return np.asarray(0.5 * (z[:, first:last:2] + z[:, first + 1 : last : 2]))


class Octaves:
    """Allan variance of several axes so far.

    Attributes
    ----------
    samples : number of added samples.
    """

    def __init__(self, axes: int) -> None:
        self._axes, self._middle = axes, np.zeros((axes, 1))
        self._levels = [_Level(axes, _FIRST)]
        self.samples = 0

    def add(self, values: Vector, follows: bool = True) -> None:
        """Add samples (axes, n); `follows` is False after a gap."""
        if not values.size:
            return
        if not self.samples:
            # without the mean, which does not matter, no digits are lost
            self._middle = values.mean(1, keepdims=True)
        self.samples += values.shape[1]
        if not follows:
            for level in self._levels:
                level.interrupt()
        blocks, at = np.asarray(values - self._middle), 0
        while blocks.size:
            if at == len(self._levels):
                self._levels.append(_Level(self._axes, _FIRST[-1:]))
            blocks = self._levels[at].add(blocks)
            at += 1

    def variances(self) -> tuple[Vector, Vector, Vector]:
        """Return tau (k,) in samples, Allan variance (k, axes), and number of differences (k,)."""
        sizes = np.concatenate([level.distances * 2**at for at, level in enumerate(self._levels)])
        sums = np.concatenate([level.sums for level in self._levels])
        counts = np.concatenate([level.counts for level in self._levels])
        seen = counts > 0
        return sizes[seen], 0.5 * sums[seen] / counts[seen, None], counts[seen]


BLOCKS = 2048
FIRST_S = 0.5
# blocks averaged on each side of a step, and robust standard deviations that it exceeds
STEP_BLOCKS, STEP_STD = 8, 10.0
LEAST_BLOCKS = 64
# more than drift or noise: a change of direction of gravity, and a rate
TURNED_RAD, TURNED_RAD_S = math.radians(2.0), math.radians(3.0)

SEGMENT = 4096
# a line's least height above its neighbours, beyond the limit of chance, and the probability of that limit
LEAST_EXCESS, CHANCE = 0.3, 1e-4
# bins: half widths of the neighbourhoods and of a line
NEIGHBOUR_BINS, LINE_BINS = (8, 32), 2


class Trace:
    """Means of columns over blocks of `seconds`; blocks are merged in pairs to limit their number."""

    def __init__(self, columns: int, rate_hz: float) -> None:
        self._size = max(round(FIRST_S * rate_hz), 1)
        self._rate_hz = rate_hz
        self._means: list[Vector] = []
        self._held = np.zeros((columns, 0))

    def add(self, values: Vector) -> None:
        """Add samples (columns, n)."""
        self._held = np.concatenate([self._held, values], axis=1)
        columns, n = self._held.shape
        whole = n // self._size
        if not whole:
            return
        used = whole * self._size
        self._means += list(self._held[:, :used].reshape(columns, whole, self._size).mean(2).T)
        self._held = self._held[:, used:]
        while len(self._means) >= BLOCKS:
            # an odd last block is dropped
            pairs = np.array(self._means[: len(self._means) // 2 * 2]).reshape(-1, 2, columns)
            self._means = list(pairs.mean(1))
            self._size *= 2

    @property
    def seconds(self) -> float:
        """Return the duration of a block [s]."""
        return self._size / self._rate_hz

    @property
    def means(self) -> Vector:
        """Return the means (k, columns)."""
        return np.array(self._means).reshape(-1, len(self._held))


def find_steps(means: Vector) -> list[tuple[int, int, float]]:
    """Return (block, column, size) of the largest significant step of each column of means (k, columns)."""
    if len(means) < LEAST_BLOCKS:
        return []
    total = np.concatenate([np.zeros((1, means.shape[1])), np.cumsum(means - means[0], axis=0)])
    of = (total[STEP_BLOCKS:] - total[:-STEP_BLOCKS]) / STEP_BLOCKS
    jumps = of[STEP_BLOCKS:] - of[:-STEP_BLOCKS]
    spread = OF_NORMAL * np.median(np.abs(jumps - np.median(jumps, axis=0)), axis=0)
    found = []
    for column, (jump, std) in enumerate(zip(jumps.T, spread, strict=True)):
        at = int(np.abs(jump).argmax())
        if std > 0.0 and abs(jump[at]) > STEP_STD * std:
            found.append((at + STEP_BLOCKS, column, float(jump[at])))
    return found


def find_turn(means: Vector) -> tuple[int, float] | None:
    """Return the first moving block of means (k, 6) and the largest turn of gravity [rad]; None if it lay still."""
    acc, rate = means[:, :3], np.linalg.norm(means[:, 3:6] - np.median(means[:, 3:6], axis=0), axis=1)
    away = np.arctan2(np.linalg.norm(np.cross(acc, acc[0]), axis=1), acc @ acc[0])
    moved = np.flatnonzero((away > TURNED_RAD) | (rate > TURNED_RAD_S))
    return (int(moved[0]), float(away.max())) if len(moved) else None


@dataclass(frozen=True)
class Tone:
    """Line of a spectrum: axis number, frequency [Hz], rms in the samples' units."""

    axis: int
    frequency_hz: float
    rms: float


class Spectrum:
    """Mean density of several axes so far."""

    def __init__(self, axes: int) -> None:
        self._window = np.hanning(SEGMENT)
        self._held = np.zeros((axes, 0))
        self._power = np.zeros((axes, SEGMENT // 2 + 1))
        self._segments = 0

    def add(self, values: Vector, follows: bool = True) -> None:
        """Add samples (axes, n); `follows` is False after a gap."""
        self._held = np.concatenate([self._held, values], axis=1) if follows else values
        while self._held.shape[1] >= SEGMENT:
            part, self._held = self._held[:, :SEGMENT], self._held[:, SEGMENT:]
            lines = np.fft.rfft((part - part.mean(1, keepdims=True)) * self._window)
            self._power += lines.real**2 + lines.imag**2
            self._segments += 1

    def tones(self, rate_hz: float) -> list[Tone]:
        """Return the strongest line of each axis that is significant."""
        from scipy.ndimage import median_filter  # noqa: PLC0415 - slow to import
        from scipy.special import chdtri  # noqa: PLC0415

        if not self._segments:
            return []
        density = 2.0 * self._power / (self._segments * rate_hz * np.sum(self._window**2))
        freedom = 2 * self._segments
        # relative to the median, as the floor is a median of the neighbours
        most = float(chdtri(freedom, CHANCE / density.shape[1]) / chdtri(freedom, 0.5))
        found: list[Tone] = []
        for axis, of in enumerate(density):
            # the narrow neighbourhood follows a steep density, such as drift at low frequencies
            floor = np.maximum(*(median_filter(of, 2 * many + 1, mode="reflect") for many in NEIGHBOUR_BINS)) + 1e-300
            above = of / floor
            # the lowest bins are drift, and the highest lack neighbours
            above[: 2 * LINE_BINS] = above[-2 * LINE_BINS :] = 0.0
            at = int(above.argmax())
            if above[at] > (1.0 + LEAST_EXCESS) * most:
                around = slice(max(at - LINE_BINS, 0), at + LINE_BINS + 1)
                power = float(np.sum(of[around] - floor[around])) * rate_hz / SEGMENT
                found.append(Tone(axis, at * rate_hz / SEGMENT, float(np.sqrt(max(power, 0.0)))))
        return found
