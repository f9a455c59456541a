"""Where the board rests: intervals of samples in which both sensors spread little and the rate is the bias.

A moving-window static detector, as in Tedaldi, Pretto, Menegatti (ICRA 2014), with the gyroscope beside the
accelerometer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..data import Mask, Recording, Vector
from ..kernel import _kernel
from .flat_segment import Flat
from .local_noise import VIBRATION, noise_variance

WINDOW_S, SHORTEST_S = 0.5, 0.3
TRIM, LEAST_TRIM_S, MOST_TRIM_S = 0.125, 0.1, 0.25  # of a rest at either end: a hand settles, and leaves early
TIMES_QUIET = 2.5
GYRO_SD_RAD_S, ACC_SD_MPS2 = 0.03, 0.15
GYRO_MEAN_RAD_S = 0.05
TURNS_RAD_S = 0.02  # faster, the accelerometer says, it turns: neither a rest nor a bias of the gyroscope

Intervals = NDArray[np.intp]


def static_intervals(recording: Recording, flat: Flat) -> Intervals:
    """(k, 2) first and last + 1 of the runs of samples in which the board rests, the flat segment's among them.

    A half-second window is still where its spread is near the flat segment's, or below what a braced hand gives, or
    where the accelerometer's is vibration alone, and its mean rate is the bias; a sample is still where a still window
    covers it; runs are trimmed at both ends.
    """
    n = max(round(WINDOW_S * recording.rate_hz), 4)
    if len(recording) < n:
        return np.zeros((0, 2), np.intp)
    gyr_limit = np.maximum(TIMES_QUIET**2 * flat.Sigma_omega, GYRO_SD_RAD_S**2)
    acc_limit = np.maximum(TIMES_QUIET**2 * flat.Sigma_a, ACC_SD_MPS2**2)
    mean, variance = _kernel.moving_statistics(np.ascontiguousarray(recording.gyr), n)
    windows = np.all((variance < gyr_limit[:, None]) & (np.abs(mean.T - flat.b_omega).T < GYRO_MEAN_RAD_S), axis=0)
    variance = _kernel.moving_statistics(np.ascontiguousarray(recording.acc), n)[1]
    vibration = VIBRATION * noise_variance(recording)[n // 2 : n // 2 + len(windows)].T
    windows &= np.all(variance < np.maximum(vibration, acc_limit[:, None]), axis=0)
    covered = np.zeros(len(recording) + 1, np.intp)
    at = np.flatnonzero(windows)
    covered[at] += 1
    covered[at + n] -= 1
    still = (np.cumsum(covered)[:-1] > 0) & ~recording.gap
    runs, rate = _runs(still), recording.rate_hz
    trim = np.clip(TRIM * (runs[:, 1] - runs[:, 0]), LEAST_TRIM_S * rate, MOST_TRIM_S * rate).astype(np.intp)
    runs = runs + np.stack([trim, -trim], axis=1)
    runs = runs[runs[:, 1] - runs[:, 0] >= SHORTEST_S * rate]
    return np.asarray(runs[gravity_turns(recording, runs) < TURNS_RAD_S])


def gravity_turns(recording: Recording, runs: Intervals) -> Vector:
    """(k,) rad/s by which gravity turns in runs of samples, as far as it is beyond noise: from first third to last."""
    first, last = runs.T
    n = np.maximum((last - first) // 3, 1)
    one, of_one = statistics(recording.acc, np.stack([first, first + n], axis=1))
    other, of_other = statistics(recording.acc, np.stack([last - n, last], axis=1))
    angle2 = np.sum((other - one) ** 2 - 3.0 * (of_one + of_other) / n[:, None], axis=1) / np.sum(one**2, axis=1)
    return np.asarray(np.sqrt(np.maximum(angle2, 0.0)) / (recording.t[last - n] - recording.t[first]))


def statistics(values: Vector, runs: Intervals) -> tuple[Vector, Vector]:
    """Means and variances (k, 3) of values (n, 3) over runs of samples."""
    return _kernel.statistics(np.ascontiguousarray(values), np.ascontiguousarray(runs, np.int64))


def in_pieces(runs: Intervals, n: int) -> Intervals:
    """(m, 2) the runs cut into pieces of n samples; what is left of each is left out."""
    pieces = [(at, at + n) for first, last in runs.tolist() for at in range(first, last - n + 1, n)]
    return np.array(pieces, np.intp).reshape(-1, 2)


def _runs(mask: Mask) -> Intervals:
    """(k, 2) first and last + 1 of the runs of True."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.asarray(np.stack([np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)], axis=1))
