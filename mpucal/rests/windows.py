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
    length_s, m = n / recording.rate_hz, len(recording) // n
    acc_rows, gyr_rows = (values[: m * n].reshape(m, n, 3) for values in (recording.acc, recording.gyr))
    gyr, acc_sd, gyr_sd, noise, acc = _of_rows(acc_rows, gyr_rows)
    spans = (_span(recording, k * n, (k + 1) * n, length_s) for k in range(m))
    return [Window(gyr[k], acc_sd[k], gyr_sd[k], noise[k], acc[k], *span) for k, span in enumerate(spans)]


def of_rows(acc: Vector, gyr: Vector, start_s: float = 0.0, end_s: float = 1.0, whole: bool = True) -> Window:
    """The window of rows (n, 3) m/s^2 and rad/s."""
    return Window(*_of_rows(acc, gyr), start_s, end_s, whole, len(acc))


def _of_rows(acc: Vector, gyr: Vector) -> tuple[Vector, Vector, Vector, Vector, Vector]:
    """(..., 3) of rows (..., n, 3), as a window has them: gyr, acc_sd, gyr_sd, acc_noise, acc."""
    acc_mean, gyr_mean = _mean(acc), _mean(gyr)
    return gyr_mean, _deviation(acc, acc_mean), _deviation(gyr, gyr_mean), _noise(acc), acc_mean


def _window(samples: Samples, first: int, last: int, length_s: float, spread: bool) -> Window:
    acc, gyr = samples.acc[first:last], samples.gyr[first:last]
    span = _span(samples, first, last, length_s)
    if spread:
        return of_rows(acc, gyr, *span[:3])
    return Window(_mean(gyr), UNKNOWN, UNKNOWN, UNKNOWN, _mean(acc), *span)


def _span(samples: Samples, first: int, last: int, length_s: float) -> tuple[float, float, bool, int]:
    """As a window has them: start_s, end_s, whole, count."""
    start_s = float(samples.t[first])
    goes_on = last < len(samples) and not samples.gap[last]
    end_s = float(samples.t[last]) if goes_on else start_s + length_s
    return start_s, end_s, not bool(samples.gap[first:last].any()), last - first


def _mean(rows: Vector) -> Vector:
    """np.mean(rows, -2), in half its time and to the last bit."""
    return np.asarray(np.add.reduce(rows, -2) / rows.shape[-2])


def _deviation(rows: Vector, mean: Vector) -> Vector:
    """np.std(rows, -2), likewise."""
    beside = rows - mean[..., None, :]
    return np.asarray(np.sqrt(np.add.reduce(beside * beside, -2) / rows.shape[-2]))


def _noise(rows: Vector) -> Vector:
    """Of the median: one sample that a knock or a flipped bit throws off is no noise."""
    n = rows.shape[-2] - ORDER
    if n <= 0:
        return np.zeros((*rows.shape[:-2], 3))
    sizes = np.sort(np.abs(np.diff(rows, ORDER, axis=-2)), axis=-2)
    return np.asarray(sizes[..., n // 2, :] * (OF_NORMAL / math.sqrt(SQUARES)))


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
