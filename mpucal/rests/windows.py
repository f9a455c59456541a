"""Windows of fixed length over a stream of samples: mean and standard deviation of each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Samples, Vector

UNKNOWN = np.full(3, np.nan)


@dataclass(frozen=True)
class Window:
    """A short run of consecutive samples.

    Attributes
    ----------
    start_s, end_s : times of its first sample and of the one after its last, or, before a gap, its length later [s].
    acc, gyr : (3,) means [m/s^2], [rad/s]. acc_sd, gyr_sd : (3,) standard deviations.
    whole : no sample is missing within it or just before it. count : of its samples.
    """

    start_s: float
    end_s: float
    acc: Vector
    gyr: Vector
    acc_sd: Vector
    gyr_sd: Vector
    whole: bool
    count: int


class Windows:
    """Cuts samples, however they arrive, into windows of `length_s` by their own time.

    Without `spread`, their standard deviations, which take longest, are NaN.
    """

    def __init__(self, length_s: float, spread: bool = True) -> None:
        self._length_s, self._spread = length_s, spread
        self._parts: list[Samples] = []
        self._full_s = -math.inf

    def add(self, samples: Samples) -> list[Window]:
        """The windows that `samples` complete."""
        if not len(samples):
            return []
        self._parts.append(samples)
        if samples.t[-1] < self._full_s:
            return []
        pending = Samples.joined(self._parts)
        windows: list[Window] = []
        first = 0
        while True:
            self._full_s = float(pending.t[first]) + self._length_s - 1e-9
            last = int(pending.t.searchsorted(self._full_s))
            if last == len(pending):
                break
            windows.append(_window(pending, first, last, self._length_s, self._spread))
            first = last
        self._parts = [_tail(pending, first)]
        return windows


def _window(samples: Samples, first: int, last: int, length_s: float, spread: bool) -> Window:
    acc, gyr = samples.acc[first:last], samples.gyr[first:last]
    acc_mean, gyr_mean = _mean(acc), _mean(gyr)
    return Window(
        float(samples.t[first]),
        float(samples.t[first]) + length_s if samples.gap[last] else float(samples.t[last]),
        acc_mean,
        gyr_mean,
        _deviation(acc, acc_mean) if spread else UNKNOWN,
        _deviation(gyr, gyr_mean) if spread else UNKNOWN,
        not bool(samples.gap[first:last].any()),
        last - first,
    )


def _mean(rows: Vector) -> Vector:
    """np.mean(rows, 0), in half its time and to the last bit."""
    return np.asarray(np.add.reduce(rows, 0) / len(rows))


def _deviation(rows: Vector, mean: Vector) -> Vector:
    """np.std(rows, 0), likewise."""
    beside = rows - mean
    return np.asarray(np.sqrt(np.add.reduce(beside * beside, 0) / len(rows)))


def _tail(samples: Samples, first: int) -> Samples:
    return Samples(
        samples.t[first:],
        samples.acc[first:],
        samples.gyr[first:],
        samples.temperature_c[first:],
        samples.gap[first:],
        samples.acc_clipped[first:],
        samples.gyr_clipped[first:],
    )
