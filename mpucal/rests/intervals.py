"""Rests of a recording: the intervals of samples in which both sensors spread as little as in its other rests.

A moving-window static detector, as in Tedaldi, Pretto, Menegatti (ICRA 2014), which uses both sensors, and learns its
limits from the recording, since hands tremble by 0.5 to 7 deg/s as they rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray

from ..data import Mask, Recording, Vector
from ..kernel import _kernel
from .flat import Flat, samples_of_window, with_rates
from .limits import ANY_HAND, QUIET, TURNS_RAD_S, Limits, learned
from .stillness import Detector
from .windows import WINDOW_S, Spreads, noise_variance

SHORTEST_S = 0.3
# A share of a rest, within limits, is cut off at either end, since a hand settles, and leaves early.
TRIM, LEAST_TRIM_S, MOST_TRIM_S = 0.125, 0.1, 0.25
FEW = 0.25  # share of the windows that hold a sample: if fewer are still, the readings may step there
# The mean rate of a shorter rest, or of its quiet part, may be a slow turn about gravity instead of the bias.
BIAS_RUN_S = 1.0

Intervals = NDArray[np.intp]


class RestFinder:
    """Finder of the runs of samples in which the board rests, (k, 2) first and last + 1, those of the flat segment too.

    A window of half a second begins at each sample, and the session's detector judges it with the noise and bias of the
    flat segment. A sample is still if a still window covers it. Runs of still samples are trimmed at both ends.
    """

    def __init__(self, recording: Recording, flat: Flat) -> None:
        recording = with_rates(recording)
        self._recording, self._flat = recording, flat
        self._n = samples_of_window(recording)
        self._windows = _windows(recording, self._n)

    def typical(self) -> Intervals:
        """Return the rests in which the rate varies as little as in most rests of this recording.

        Only for the flat segment the limits are those of a table: within a hand's limits, that rest would include the
        time in which a hand takes the board up.
        """
        flat, rests, quiet = self._flat, self.within(self._learned()), self._quiet
        at = np.array([[flat.first, flat.last]])
        return _and_others(quiet[~_apart(quiet, at)], rests[_apart(rests, at)])

    def any_hand(self) -> Intervals:
        """Return the typical rests, and in addition those of a hand with any tremor."""
        return _and_others(self.typical(), self.within(ANY_HAND))

    def bias_runs(self, rests: Intervals) -> Intervals:
        """Return the runs whose mean rate is the gyroscope's bias: the quiet part of a rest if it is long, or all."""
        quiet = self._quiet
        quiet = quiet[quiet[:, 1] - quiet[:, 0] >= BIAS_RUN_S * self._recording.rate_hz]
        return _and_others(quiet[~_apart(quiet, rests)], rests)

    def within(self, limits: Limits) -> Intervals:
        """Return the rests within these limits."""
        recording, flat = self._recording, self._flat
        if self._windows is None:
            return np.zeros((0, 2), np.intp)
        detector = Detector(limits, (np.sqrt(flat.Sigma_a), np.sqrt(flat.Sigma_omega)), flat.b_omega)
        at = np.flatnonzero(np.concatenate([detector.shares(part).level for part in self._windows.parts()]) < 1.0)
        changes = np.zeros(len(recording) + 1, np.intp)
        changes[at] += 1
        changes[at + self._n] -= 1
        covered = np.cumsum(changes)[:-1]
        still = (covered > 0) & ~recording.gap
        # Where readings step from one rest to the next, few still windows hold samples of both.
        few = true_runs((covered < FEW * self._n) & still)
        inside = (few[:, 0] > 0) & (few[:, 1] < len(still))
        for first, last in few[inside].tolist():
            if still[first - 1] and still[last]:
                still[first:last] = False
        levels = [true_runs(still)]
        # A run in which gravity turns is replaced by its samples with little rate.
        slow = np.asarray(np.all(np.abs(self._windows.gyr - flat.b_omega) < TURNS_RAD_S, axis=1))
        still[self._n // 2 : self._n // 2 + len(slow)] &= slow
        runs = true_runs(still)
        # Where gravity turns without a rate, the sensor changed: such a run is halved until gravity rests in the parts.
        while len(runs):
            levels.append(runs)
            runs = _halves(runs, self._n)
        return reduce(_and_others, self._trimmed(levels))

    @cached_property
    def _quiet(self) -> Intervals:
        return self.within(QUIET)

    def _trimmed(self, levels: list[Intervals]) -> Iterator[Intervals]:
        """Yield, for each level, its runs without their ends, if they are long enough and gravity does not turn."""
        rate = self._recording.rate_hz
        # All at once, since there are many levels of few runs.
        runs, level = np.concatenate(levels), np.repeat(np.arange(len(levels)), list(map(len, levels)))
        trim = np.clip(TRIM * (runs[:, 1] - runs[:, 0]), LEAST_TRIM_S * rate, MOST_TRIM_S * rate).astype(np.intp)
        runs = runs + np.stack([trim, -trim], axis=1)
        is_long = runs[:, 1] - runs[:, 0] >= SHORTEST_S * rate
        runs, level = runs[is_long], level[is_long]
        rests = gravity_turns(self._recording, runs) < TURNS_RAD_S
        return (runs[rests & (level == k)] for k in range(len(levels)))

    def _learned(self) -> Limits:
        if self._windows is None:
            return QUIET
        after, flat = self._windows.gyr_sd[self._flat.last :], self._flat
        spread = np.sqrt(np.maximum((after**2 - flat.Sigma_omega).max(1), 0.0))
        speed = np.abs(self._windows.gyr[flat.last :] - flat.b_omega).max(1)
        noise, fewest = float(np.sqrt(flat.Sigma_omega.max())), WINDOW_S * self._recording.rate_hz
        return learned(spread, speed, noise, fewest)


def _and_others(runs: Intervals, others: Intervals) -> Intervals:
    """Return the runs, and the `others` that overlap none of them, in order of time."""
    both = np.concatenate([runs, others[_apart(others, runs)]])
    # Two sorted runs are merged. NumPy's default for AVX2 crashed in QEMU's emulation of it.
    return np.asarray(both[np.argsort(both[:, 0], kind="stable")])


def _halves(runs: Intervals, n: int) -> Intervals:
    """Return the halves of runs that have n samples or more."""
    (first, last), middle = runs.T, runs.sum(axis=1) // 2
    halves = np.stack([first, middle, middle, last], axis=1).reshape(-1, 2)
    return np.asarray(halves[halves[:, 1] - halves[:, 0] >= n])


def _apart(runs: Intervals, others: Intervals) -> Mask:
    """Return (k,) True for runs that overlap none of the others.

    As many of the others end before such a run begins as begin before it ends.
    """
    ended = np.searchsorted(others[:, 1], runs[:, 0], side="right")
    begun = np.searchsorted(others[:, 0], runs[:, 1], side="left")
    return np.asarray(ended == begun)


def gravity_turns(recording: Recording, runs: Intervals) -> Vector:
    """Return (k,) how fast gravity turns in runs of samples [rad/s], from first third to last, beyond noise."""
    first, last = runs.T
    n = np.maximum((last - first) // 3, 1)
    one, of_one = statistics(recording.acc, np.stack([first, first + n], axis=1))
    other, of_other = statistics(recording.acc, np.stack([last - n, last], axis=1))
    away2 = np.sum((other - one) ** 2 - 3.0 * (of_one + of_other) / n[:, None], axis=1)
    size2 = np.sum(one**2, axis=1)
    # An accelerometer that reads only zeros shows no gravity, and so no rest.
    angle2 = np.divide(away2, size2, out=np.full(len(size2), np.inf), where=size2 > 0.0)
    seconds = recording.t[last - n] - recording.t[first]  # 0 in a run of one sample: it may turn at any rate
    angle = np.sqrt(np.maximum(angle2, 0.0))
    return np.asarray(np.divide(angle, seconds, out=np.full(len(runs), np.inf), where=seconds > 0.0))


def statistics(values: Vector, runs: Intervals) -> tuple[Vector, Vector]:
    """Return means and variances (k, 3) of values (n, 3) over runs of samples."""
    return _kernel.statistics(np.ascontiguousarray(values), np.ascontiguousarray(runs, np.int64))


def block_means(values: Vector, n: int) -> Vector:
    """Return means (m, 3) of consecutive blocks of n samples of values, without an incomplete last one."""
    first = n * np.arange(len(values) // n)
    return statistics(values, np.stack([first, first + n], axis=1))[0]


def _windows(recording: Recording, n: int) -> Spreads | None:
    if len(recording) < n:
        return None
    gyr, gyr_variance = _kernel.moving_statistics(np.ascontiguousarray(recording.gyr), n)
    acc_variance = _kernel.moving_statistics(np.ascontiguousarray(recording.acc), n)[1]
    # All by axis in memory, since operations over rows of three take five times as long.
    noise = np.ascontiguousarray(noise_variance(recording)[n // 2 : n // 2 + acc_variance.shape[1]].T)
    return Spreads(gyr.T, *(np.sqrt(np.maximum(x, 0.0)).T for x in (acc_variance, gyr_variance, noise)))


def true_runs(mask: Mask) -> Intervals:
    """Return (k, 2) first and last + 1 of the runs of True."""
    edged = np.zeros(len(mask) + 2, bool)
    edged[1:-1] = mask
    return np.flatnonzero(edged[1:] != edged[:-1]).reshape(-1, 2)
