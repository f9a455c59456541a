"""Windows of fixed length over a stream of samples: the mean, standard deviation and noise of each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..data import RUN, Recording, Samples, Vector
from ..kernel import _kernel
from .limits import OF_NORMAL

WINDOW_S = 0.5  # length of a window for the detection of rests, noise and turns of gravity
UNKNOWN = np.full(3, np.nan)
# Fourth differences leave noise and vibration, and next to nothing of a hand's motion below 10 Hz at 100 samples/s or
# more. SQUARES is the sum of the squares of their coefficients 1, -4, 6, -4, 1.
ORDER, SQUARES = 4, 70.0
# Ratio of variances up to which a window may be as noisy as the flat segment, but for chance and a hand.
LOUDER = 2.0


@dataclass(frozen=True)
class Spreads:
    """Statistics of one window (3,), or of many (m, 3), that decide whether it is still.

    Attributes
    ----------
    gyr : mean rates [rad/s]. acc_sd, gyr_sd : standard deviations [m/s^2], [rad/s].
    acc_noise : the accelerometer's noise and vibration, without the hand's motion, as a standard deviation [m/s^2].
    """

    gyr: Vector
    acc_sd: Vector
    gyr_sd: Vector
    acc_noise: Vector

    def parts(self) -> Iterator[Spreads]:
        """Yield the windows in parts of which each takes little memory."""
        for first in range(0, len(self.gyr), RUN):
            yield Spreads(*(each[first : first + RUN] for each in vars(self).values()))


@dataclass(frozen=True)
class Window(Spreads):
    """Statistics of a short run of consecutive samples.

    Attributes
    ----------
    acc : (3,) m/s^2, mean.
    start_s, end_s : times of its first sample and of the one after its last [s]; where that is missing, `end_s` is
        `start_s` plus the length of a window.
    whole : no sample is missing within it or just before it. count : number of its samples.
    """

    acc: Vector
    start_s: float
    end_s: float
    whole: bool
    count: int


class Windows:
    """Cutter of samples, as they arrive, into windows of `length_s` by the samples' times.

    Without `spread`, the standard deviations, which take longest, are NaN.
    """

    def __init__(self, length_s: float, spread: bool = True) -> None:
        self._length_s, self._spread = length_s, spread
        self._parts: list[Samples] = []
        self._full_s = -math.inf

    def add(self, samples: Samples) -> list[Window]:
        """Return the windows that `samples` complete."""
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
        self._parts = [pending.each(lambda array: array[first:])]
        return windows


@dataclass(frozen=True)
class CutWindows(Spreads):
    """Windows of n samples, all of a recording but an incomplete last one; acc : (m, 3) m/s^2, means."""

    acc: Vector
    recording: Recording
    n: int

    @classmethod
    def of(cls, recording: Recording, n: int) -> CutWindows:
        """Cut a recording into windows of n samples."""
        m = len(recording) // n
        acc, gyr = (values[: m * n].reshape(m, n, 3) for values in (recording.acc, recording.gyr))
        return cls(*_of_rows(acc, gyr), recording, n)

    def __len__(self) -> int:
        return len(self.acc)

    def __getitem__(self, k: int) -> Window:
        span = _span(self.recording, k * self.n, (k + 1) * self.n, self.n / self.recording.rate_hz)
        return Window(self.gyr[k], self.acc_sd[k], self.gyr_sd[k], self.acc_noise[k], self.acc[k], *span)


def of_rows(acc: Vector, gyr: Vector, start_s: float = 0.0, end_s: float = 1.0, whole: bool = True) -> Window:
    """Return the window of rows (n, 3) [m/s^2] and [rad/s]."""
    return Window(*_of_rows(acc, gyr), start_s, end_s, whole, len(acc))


def _of_rows(acc: Vector, gyr: Vector) -> tuple[Vector, Vector, Vector, Vector, Vector]:
    """Return (..., 3) of rows (..., n, 3), in the order of a window's fields: gyr, acc_sd, gyr_sd, acc_noise, acc."""
    # Both sensors at once, and the mean once: a session does this for each window.
    rows = np.concatenate((acc, gyr), axis=-1)
    n = rows.shape[-2]
    mean = np.add.reduce(rows, -2) / n
    rows -= mean[..., None, :]
    rows *= rows
    sd = np.sqrt(np.add.reduce(rows, -2) / n)
    return mean[..., 3:], sd[..., :3], sd[..., 3:], _noise(acc), mean[..., :3]


def _window(samples: Samples, first: int, last: int, length_s: float, spread: bool) -> Window:
    acc, gyr = samples.acc[first:last], samples.gyr[first:last]
    span = _span(samples, first, last, length_s)
    if spread:
        return of_rows(acc, gyr, *span[:3])
    n = last - first  # a sum is divided in half the time of mean
    return Window(np.add.reduce(gyr) / n, UNKNOWN, UNKNOWN, UNKNOWN, np.add.reduce(acc) / n, *span)


def _span(samples: Samples, first: int, last: int, length_s: float) -> tuple[float, float, bool, int]:
    """Return start_s, end_s, whole and count of a window."""
    start_s = float(samples.t[first])
    goes_on = last < len(samples) and not samples.gap[last]
    end_s = float(samples.t[last]) if goes_on else start_s + length_s
    return start_s, end_s, not bool(samples.gap[first:last].any()), last - first


def _noise(rows: Vector) -> Vector:
    """Return the noise by the median of fourth differences, which a knock or a flipped bit does not move."""
    n = rows.shape[-2] - ORDER
    if n <= 0:
        return np.zeros((*rows.shape[:-2], 3))
    for _ in range(ORDER):
        rows = rows[..., 1:, :] - rows[..., :-1, :]
    sizes = np.sort(np.abs(rows), axis=-2)
    return np.asarray(sizes[..., n // 2, :] * (OF_NORMAL / math.sqrt(SQUARES)))


def noise_variance(recording: Recording) -> Vector:
    """Return the accelerometer's noise around each sample, (n, 3) (m/s^2)^2, as if white, by fourth differences.

    A motor that starts makes it louder than it was at rest. What changed across a gap is no noise.
    """
    half, acc = max(round(WINDOW_S * recording.rate_hz) // 2, 2), recording.acc
    if recording.gap.any():
        acc = acc - np.cumsum(np.where(recording.gap[:, None], np.diff(acc, axis=0, prepend=acc[:1]), 0.0), axis=0)
    return _kernel.noise_variance(np.ascontiguousarray(acc), half)


def noise_ratio(recording: Recording, Sigma_a: Vector) -> Vector:
    """Return (n,) the noise around each sample as a factor of Sigma_a (3,); 1 where it is as at rest."""
    ratio = noise_variance(recording) @ (1.0 / (3.0 * Sigma_a))
    return np.asarray(np.where(ratio > LOUDER, ratio, 1.0))
