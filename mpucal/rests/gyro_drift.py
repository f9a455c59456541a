"""The gyroscope's bias as a random walk, seen at the rests: smoothed and removed.

Source of the smoother: Rauch, Tung, Striebel (1965).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Recording, Vector
from .flat import Flat
from .intervals import TELLS_BIAS_S, Intervals, gravity_turns, statistics

TURNING_RAD_S = 0.005  # slower, gravity wanders by a hand that settles and by noise
TREMOR_S = 0.05  # correlation time of a hand's tremor
RANDOM_WALKS = 10.0 ** np.arange(-13.0, -3.0, 0.5)  # (rad/s)^2 a second; the first is none
DRIFTS_99 = 11.3  # scipy.stats.chi2.ppf(0.99, 3): twice what the log likelihood gains by walks of chance, on three axes


def remove_drift(recording: Recording, flat: Flat, runs: Intervals) -> Recording:
    """The recording with its gyroscope's drift removed: in every rest, the mean rate is the flat segment's.

    The bias is a random walk seen through the means of runs at rest, its density the likeliest; between them it is
    drawn straight.
    """
    runs = runs[runs[:, 1] - runs[:, 0] >= TELLS_BIAS_S * recording.rate_hz]
    if len(runs) < 2:
        return recording
    first, last = runs.T
    t, n = 0.5 * (recording.t[first] + recording.t[last - 1]), (last - first)[:, None]
    mean, spread = statistics(recording.gyr, runs)
    tremor = np.maximum(spread - 1.2 * flat.Sigma_omega, 0.0)
    variance = flat.Sigma_omega / n + tremor * np.minimum(1.0, 2.0 * TREMOR_S * recording.rate_hz / n)
    # so far a run's mean rate may be a turn and no bias
    variance = variance + np.maximum(gravity_turns(recording, runs) - TURNING_RAD_S, 0.0)[:, None] ** 2
    walk = _smoothed(t, mean, variance)
    bias = np.stack([np.interp(recording.t, t, column) for column in walk.T], axis=1)
    return replace(recording, gyr=recording.gyr - bias + flat.b_omega)


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
    likeliest = cost.argmin(1) if np.sum(cost[:, 0] - cost.min(1)) > DRIFTS_99 else 0
    return np.asarray(m[:, np.arange(3), likeliest])
