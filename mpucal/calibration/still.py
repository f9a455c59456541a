"""Where the board rests between moves, and what the gyroscope's bias does meanwhile. Knows no accelerometer model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..data import Mask, Recording, Vector
from .model import Flat

WINDOW_S, SHORTEST_S = 0.5, 0.3
TRIM, LEAST_TRIM_S, MOST_TRIM_S = 0.125, 0.1, 0.25  # of a rest at either end: a hand settles, and leaves early
TIMES_QUIET = 2.5
GYRO_SD_RAD_S, ACC_SD_MPS2 = 0.03, 0.15
GYRO_MEAN_RAD_S = 0.05

LONG_ENOUGH_FOR_BIAS_S = 0.5
TREMOR_S = 0.05  # correlation time of a hand's tremor
RANDOM_WALKS = 10.0 ** np.arange(-13.0, -3.0, 0.5)  # (rad/s)^2 a second

Runs = NDArray[np.intp]


def still_runs(recording: Recording, flat: Flat) -> Runs:
    """(k, 2) first and last + 1 of the runs of samples in which the board rests, the flat segment's among them.

    A half-second window is still where its spread is near the flat segment's, or below what a braced hand gives, and
    its mean rate is the bias; a sample is still where a still window covers it; runs are trimmed at both ends.
    """
    n = max(round(WINDOW_S * recording.rate_hz), 4)
    if len(recording) < n:
        return np.zeros((0, 2), np.intp)
    gyr_limit = np.maximum(TIMES_QUIET * np.sqrt(flat.Sigma_omega), GYRO_SD_RAD_S)
    acc_limit = np.maximum(TIMES_QUIET * np.sqrt(flat.Sigma_a), ACC_SD_MPS2)
    windows = np.ones(len(recording) - n + 1, bool)
    for i in range(3):  # an axis at a time: what it takes in between is several times the recording
        mean, sd = _moving(recording.gyr[:, i], n)
        windows &= (sd < gyr_limit[i]) & (np.abs(mean - flat.b_omega[i]) < GYRO_MEAN_RAD_S)
        windows &= _moving(recording.acc[:, i], n)[1] < acc_limit[i]
    covered = np.zeros(len(recording) + 1, np.intp)
    at = np.flatnonzero(windows)
    np.add.at(covered, at, 1)
    np.add.at(covered, at + n, -1)
    still = (np.cumsum(covered)[:-1] > 0) & ~recording.gap
    runs, rate = _runs(still), recording.rate_hz
    trim = np.clip(TRIM * (runs[:, 1] - runs[:, 0]), LEAST_TRIM_S * rate, MOST_TRIM_S * rate).astype(np.intp)
    runs = runs + np.stack([trim, -trim], axis=1)
    return np.asarray(runs[runs[:, 1] - runs[:, 0] >= SHORTEST_S * rate])


def without_drift(recording: Recording, flat: Flat, runs: Runs) -> Recording:
    """The recording with its gyroscope's drift removed: in every run, the mean rate is the flat segment's.

    The bias is a random walk seen through the runs' means, smoothed (Rauch, Tung, Striebel), its density chosen by
    likelihood; between runs it is drawn straight.
    """
    runs = runs[runs[:, 1] - runs[:, 0] >= LONG_ENOUGH_FOR_BIAS_S * recording.rate_hz]
    if len(runs) < 2:
        return recording
    t = np.array([0.5 * (recording.t[a] + recording.t[b - 1]) for a, b in runs])
    n = (runs[:, 1] - runs[:, 0])[:, None]
    rests = [recording.gyr[a:b].T for a, b in runs]
    tremor = np.maximum([[axis.var() for axis in rest] for rest in rests] - 1.2 * flat.Sigma_omega, 0.0)
    variance = flat.Sigma_omega / n + tremor * np.minimum(1.0, 2.0 * TREMOR_S * recording.rate_hz / n)
    walk = _smoothed(t, np.array([[axis.mean() for axis in rest] for rest in rests]), variance)
    bias = np.stack([np.interp(recording.t, t, column) for column in walk.T], axis=1)
    return replace(recording, gyr=recording.gyr - bias + flat.b_omega)


def _moving(values: Vector, n: int) -> tuple[Vector, Vector]:
    """Means and standard deviations (len - n + 1,) of all windows of n samples of an axis."""
    middle = values.mean()
    x = np.concatenate([[0.0], values - middle])
    sums, squares = np.cumsum(x), np.cumsum(x * x)
    mean = (sums[n:] - sums[:-n]) / n
    variance = (squares[n:] - squares[:-n]) / n - mean**2
    return mean + middle, np.sqrt(np.maximum(variance, 0.0))


def _runs(mask: Mask) -> Runs:
    """(k, 2) first and last + 1 of the runs of True."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.asarray(np.stack([np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)], axis=1))


def _smoothed(t: Vector, mean: Vector, variance: Vector) -> Vector:
    """(k, 3) the random walks behind the rows of measurements (k, 3) of given variance, each of the likeliest density.

    All densities go side by side; (k, 3, q) in between.
    """
    k, q = len(t), RANDOM_WALKS
    m, P, m_before, P_before = (np.empty((k, 3, len(q))) for _ in range(4))
    cost = np.zeros((3, len(q)))
    m[0], P[0] = mean[0, :, None], variance[0, :, None]
    for i in range(1, k):
        m_before[i], P_before[i] = m[i - 1], P[i - 1] + q * (t[i] - t[i - 1])
        S = P_before[i] + variance[i, :, None]
        gain, e = P_before[i] / S, mean[i, :, None] - m_before[i]
        cost += np.log(S) + e * e / S
        m[i], P[i] = m_before[i] + gain * e, (1.0 - gain) * P_before[i]
    for i in range(k - 2, -1, -1):
        m[i] += P[i] / P_before[i + 1] * (m[i + 1] - m_before[i + 1])
    return np.asarray(m[:, np.arange(3), cost.argmin(1)])
