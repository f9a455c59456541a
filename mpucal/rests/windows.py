"""Windows of fixed length over a stream of samples: mean and standard deviation of each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Recording, Samples, Vector
from .limits import OF_NORMAL
from .local_noise import ORDER, SQUARES

UNKNOWN = np.full(3, np.nan)


@dataclass(frozen=True)
class Spreads:
    """Says of one window (3,), or of many (m, 3), what tells whether it is still.

    Attributes
    ----------
    gyr : mean rates [rad/s]. acc_sd, gyr_sd : standard deviations [m/s^2], [rad/s].
    acc_noise : the accelerometer's noise and vibration, without the hand (local_noise.py).
    """

    gyr: Vector
    acc_sd: Vector
    gyr_sd: Vector
    acc_noise: Vector


@dataclass(frozen=True)
class Window(Spreads):
    """A short run of consecutive samples.

    Attributes
    ----------
    acc : (3,) m/s^2, mean.
    start_s, end_s : times of its first sample and of the one after its last, or, where there is none or a gap, its
        length later [s].
    whole : no sample is missing within it or just before it. count : of its samples.
    """

    acc: Vector
    start_s: float
    end_s: float
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


def cut(recording: Recording, n: int) -> list[Window]:
    """The windows of n samples of a whole recording; what is left at its end is left out."""
    length_s = n / recording.rate_hz
    return [_window(recording, last - n, last, length_s, True) for last in range(n, len(recording) + 1, n)]


def of_rows(acc: Vector, gyr: Vector, start_s: float = 0.0, end_s: float = 1.0, whole: bool = True) -> Window:
    """The window of rows (n, 3) m/s^2 and rad/s."""
    acc_mean, gyr_mean = _mean(acc), _mean(gyr)
    deviations = _deviation(acc, acc_mean), _deviation(gyr, gyr_mean), _noise(acc)
    return Window(gyr_mean, *deviations, acc_mean, start_s, end_s, whole, len(acc))


def _window(samples: Samples, first: int, last: int, length_s: float, spread: bool) -> Window:
    acc, gyr, start_s = samples.acc[first:last], samples.gyr[first:last], float(samples.t[first])
    goes_on = last < len(samples) and not samples.gap[last]
    end_s = float(samples.t[last]) if goes_on else start_s + length_s
    whole = not bool(samples.gap[first:last].any())
    if spread:
        return of_rows(acc, gyr, start_s, end_s, whole)
    return Window(_mean(gyr), UNKNOWN, UNKNOWN, UNKNOWN, _mean(acc), start_s, end_s, whole, last - first)


def _mean(rows: Vector) -> Vector:
    """np.mean(rows, 0), in half its time and to the last bit."""
    return np.asarray(np.add.reduce(rows, 0) / len(rows))


def _deviation(rows: Vector, mean: Vector) -> Vector:
    """np.std(rows, 0), likewise."""
    beside = rows - mean
    return np.asarray(np.sqrt(np.add.reduce(beside * beside, 0) / len(rows)))


def _noise(rows: Vector) -> Vector:
    """Of the median: one sample that a knock or a flipped bit throws off is no noise."""
    if len(rows) <= ORDER:
        return np.zeros(3)
    sizes = np.sort(np.abs(np.diff(rows, ORDER, axis=0)), axis=0)
    return np.asarray(sizes[len(sizes) // 2] * (OF_NORMAL / math.sqrt(SQUARES)))


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
