"""Drift of the gyroscope's bias: a random walk, measured at the rests, smoothed and removed.

Source of the smoother: Rauch, Tung, Striebel (1965).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Recording, Vector
from .flat import Flat
from .intervals import BIAS_RUN_S, Intervals, gravity_turns, statistics

TURNING_RAD_S = 0.005  # gravity that turns more slowly is moved by a hand that settles, and by noise
TREMOR_S = 0.05  # correlation time of a hand's tremor
RANDOM_WALKS = 10.0 ** np.arange(-13.0, -3.0, 0.5)  # densities, (rad/s)^2 a second; the first is none
# Twice the gain of the log likelihood by walks on three axes; by chance 5 % gain as much, since a density is not
# negative: the mixture 1/8 chi2(0) + 3/8 chi2(1) + 3/8 chi2(2) + 1/8 chi2(3).
DRIFTS_95 = 5.4


def remove_drift(recording: Recording, flat: Flat, runs: Intervals) -> Recording:
    """Remove the gyroscope's drift, so that the mean rate of every rest is the flat segment's.

    The bias is a random walk of the most likely density, measured by the means of runs at rest, and interpolated
    linearly between them.
    """
    runs = runs[runs[:, 1] - runs[:, 0] >= BIAS_RUN_S * recording.rate_hz]
    if len(runs) < 2:
        return recording
    first, last = runs.T
    t, n = 0.5 * (recording.t[first] + recording.t[last - 1]), (last - first)[:, None]
    mean, spread = statistics(recording.gyr, runs)
    tremor = np.maximum(spread - 1.2 * flat.Sigma_omega, 0.0)
    variance = flat.Sigma_omega / n + tremor * np.minimum(1.0, 2.0 * TREMOR_S * recording.rate_hz / n)
    # As far as gravity turns in a run, its mean rate may be a turn and no bias.
    variance = variance + np.maximum(gravity_turns(recording, runs) - TURNING_RAD_S, 0.0)[:, None] ** 2
    walk = _smoothed(t, mean, variance)
    bias = np.stack([np.interp(recording.t, t, column) for column in walk.T], axis=1)
    return replace(recording, gyr=recording.gyr - bias + flat.b_omega)


def _smoothed(t: Vector, mean: Vector, variance: Vector) -> Vector:
    """Smooth random walks (k, 3), measured with a variance (k, 3), each with its most likely density.

    The filter runs for all q densities at once, on arrays (k, 3, q).
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
    best = cost.argmin(1) if np.sum(cost[:, 0] - cost.min(1)) > DRIFTS_95 else 0
    return np.asarray(m[:, np.arange(3), best])
