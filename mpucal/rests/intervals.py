"""Where the board rests: intervals of samples in which both sensors spread as little as in this recording's rests.

A moving-window static detector, as in Tedaldi, Pretto, Menegatti (ICRA 2014), with the gyroscope beside the
accelerometer, and with limits that the recording itself gives: hands tremble by 0.5 to 7 deg/s as they rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..data import Mask, Recording, Vector
from ..kernel import _kernel
from .flat import Flat
from .limits import ANY_HAND, QUIET, Limits
from .local_noise import VIBRATION, noise_variance

WINDOW_S, SHORTEST_S = 0.5, 0.3
TRIM, LEAST_TRIM_S, MOST_TRIM_S = 0.125, 0.1, 0.25  # of a rest at either end: a hand settles, and leaves early
TIMES_QUIET = 2.5
TURNS_RAD_S = 0.02  # faster, the accelerometer says, it turns: neither a rest nor a bias of the gyroscope
# So many standard deviations may the logarithm of a window's spread be above the median of windows that may be rests.
LIKE_THE_OTHERS = 2.0
FEWEST_S = 0.5  # of such windows
LEAST_OF_QUIET, LEAST_OF_NOISE = 0.1, 0.5  # a smaller spread than these shares is chance
OF_NORMAL = 1.4826  # a standard deviation beside the median of distances
# So long a rest, or its quiet part, tells the gyroscope's bias: in less, a slow turn about gravity passes for it.
TELLS_BIAS_S = 1.0

Intervals = NDArray[np.intp]


class _Windows(NamedTuple):
    """Half-second windows, one beginning at each sample but the last ones: (3, m) each.

    gyro_mean : rad/s, beside the flat segment's. gyro, acc : variances. vibration : that of the accelerometer where it
    vibrates and does not move.
    """

    n: int
    gyro_mean: Vector
    gyro: Vector
    acc: Vector
    vibration: Vector


def static_intervals(recording: Recording, flat: Flat, limits: Limits | None = None) -> Intervals:
    """(k, 2) first and last + 1 of the runs of samples in which the board rests, the flat segment's among them.

    A half-second window is still where its spread is within the limits or near the flat segment's, or where the
    accelerometer's is vibration alone, and its mean rate is the bias; a sample is still where a still window covers it;
    runs are trimmed at both ends. Without `limits` they are what this recording's rests are like.
    """
    windows = _windows(recording, flat)
    return np.zeros((0, 2), np.intp) if windows is None else _intervals(recording, flat, windows, limits)


def bias_intervals(recording: Recording, flat: Flat, rests: Intervals) -> Intervals:
    """(k, 2) the runs that tell the gyroscope's bias: a rest's quiet part where that is long, or all of it."""
    windows = _windows(recording, flat)
    if windows is None:
        return rests
    quiet = _intervals(recording, flat, windows, QUIET)
    quiet = quiet[quiet[:, 1] - quiet[:, 0] >= TELLS_BIAS_S * recording.rate_hz]
    return _and_others(quiet[~_apart(quiet, rests)], rests)


def _and_others(runs: Intervals, others: Intervals) -> Intervals:
    """The runs, and those of the others that overlap none of them."""
    both = np.concatenate([runs, others[_apart(others, runs)]])
    return np.asarray(both[np.argsort(both[:, 0])])


def _apart(runs: Intervals, others: Intervals) -> Mask:
    """(k,) the runs that overlap none of the others: as many of these end before one begins as begin before it ends."""
    ended = np.searchsorted(others[:, 1], runs[:, 0], side="right")
    begun = np.searchsorted(others[:, 0], runs[:, 1], side="left")
    return np.asarray(ended == begun)


def held_intervals(recording: Recording, flat: Flat) -> Intervals:
    """(k, 2) the rests, and beside them whatever a hand of any tremor may have meant to hold."""
    return _and_others(static_intervals(recording, flat), static_intervals(recording, flat, ANY_HAND))


def learned(spread: Vector, speed: Vector, fewest: float = 0.0) -> Limits:
    """The limits of a recording's rests, from the windows after its flat segment.

    The windows that may be rests have a spread within ANY_HAND's and a mean rate within QUIET's. The logarithms of
    their spreads have a median and a standard deviation; the limit lies LIKE_THE_OTHERS of these above it.

    spread : (m,) rad/s, the largest standard deviation of the rate's axes beyond noise. speed : (m,) rad/s, the largest
    mean rate beside the bias. fewest : of so few windows that may be rests nothing is learned.
    """
    held = (spread < ANY_HAND.gyro_sd) & (speed < QUIET.gyro_mean)
    if np.count_nonzero(held) <= fewest:
        return QUIET
    size = np.log(spread[held])
    median = np.median(size)
    deviation = OF_NORMAL * np.median(np.abs(size - median))
    likely = float(np.exp(median + LIKE_THE_OTHERS * deviation))
    return QUIET.wider(min(max(likely, QUIET.gyro_sd), ANY_HAND.gyro_sd))


def gravity_turns(recording: Recording, runs: Intervals) -> Vector:
    """(k,) rad/s by which gravity turns in runs of samples, as far as it is beyond noise: from first third to last."""
    first, last = runs.T
    n = np.maximum((last - first) // 3, 1)
    one, of_one = statistics(recording.acc, np.stack([first, first + n], axis=1))
    other, of_other = statistics(recording.acc, np.stack([last - n, last], axis=1))
    away2 = np.sum((other - one) ** 2 - 3.0 * (of_one + of_other) / n[:, None], axis=1)
    size2 = np.sum(one**2, axis=1)
    # an accelerometer that reads nothing but zeros shows no gravity that could stand still
    angle2 = np.divide(away2, size2, out=np.full(len(size2), np.inf), where=size2 > 0.0)
    return np.asarray(np.sqrt(np.maximum(angle2, 0.0)) / (recording.t[last - n] - recording.t[first]))


def statistics(values: Vector, runs: Intervals) -> tuple[Vector, Vector]:
    """Means and variances (k, 3) of values (n, 3) over runs of samples."""
    return _kernel.statistics(np.ascontiguousarray(values), np.ascontiguousarray(runs, np.int64))


def in_pieces(runs: Intervals, n: int) -> Intervals:
    """(m, 2) the runs cut into pieces of n samples; what is left of each is left out."""
    pieces = [(at, at + n) for first, last in runs.tolist() for at in range(first, last - n + 1, n)]
    return np.array(pieces, np.intp).reshape(-1, 2)


def _windows(recording: Recording, flat: Flat) -> _Windows | None:
    n = max(round(WINDOW_S * recording.rate_hz), 4)
    if len(recording) < n:
        return None
    mean, gyro = _kernel.moving_statistics(np.ascontiguousarray(recording.gyr), n)
    acc = _kernel.moving_statistics(np.ascontiguousarray(recording.acc), n)[1]
    vibration = VIBRATION * noise_variance(recording)[n // 2 : n // 2 + acc.shape[1]].T
    return _Windows(n, (mean.T - flat.b_omega).T, gyro, acc, vibration)


def _intervals(recording: Recording, flat: Flat, windows: _Windows, limits: Limits | None) -> Intervals:
    speed = np.abs(windows.gyro_mean).max(0)
    if limits is None:
        beyond = np.sqrt(np.maximum((windows.gyro.T - flat.Sigma_omega).max(1), 0.0))
        least = max(LEAST_OF_QUIET * QUIET.gyro_sd, LEAST_OF_NOISE * float(np.sqrt(flat.Sigma_omega.max())))
        fewest = FEWEST_S * recording.rate_hz
        limits = learned(np.maximum(beyond[flat.last :], least), speed[flat.last :], fewest)
    gyro_limit = np.maximum(TIMES_QUIET**2 * flat.Sigma_omega, limits.gyro_sd**2)
    acc_limit = np.maximum(TIMES_QUIET**2 * flat.Sigma_a, limits.acc_sd**2)
    still = np.all(windows.gyro < gyro_limit[:, None], axis=0) & (speed < limits.gyro_mean)
    still &= np.all(windows.acc < np.maximum(windows.vibration, acc_limit[:, None]), axis=0)
    covered = np.zeros(len(recording) + 1, np.intp)
    at = np.flatnonzero(still)
    covered[at] += 1
    covered[at + windows.n] -= 1
    runs, rate = _runs((np.cumsum(covered)[:-1] > 0) & ~recording.gap), recording.rate_hz
    trim = np.clip(TRIM * (runs[:, 1] - runs[:, 0]), LEAST_TRIM_S * rate, MOST_TRIM_S * rate).astype(np.intp)
    runs = runs + np.stack([trim, -trim], axis=1)
    runs = runs[runs[:, 1] - runs[:, 0] >= SHORTEST_S * rate]
    return np.asarray(runs[gravity_turns(recording, runs) < TURNS_RAD_S])


def _runs(mask: Mask) -> Intervals:
    """(k, 2) first and last + 1 of the runs of True."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.asarray(np.stack([np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)], axis=1))
