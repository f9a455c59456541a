"""Drift of the gyroscope's bias, and its sensitivity to acceleration, measured at the rests and removed.

Source of the smoother: Rauch, Tung, Striebel (1965).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Recording, Vector
from .flat import Flat
from .intervals import BIAS_RUN_S, Intervals, gravity_turns, statistics
from .tremor import TREMOR_PER_S

RANDOM_WALKS = 10.0 ** np.arange(-13.0, -3.0, 0.5)  # densities, (rad/s)^2 a second; the first is none
# Twice the gain of the log likelihood by walks on three axes; by chance 5 % gain as much, since a density is not
# negative: the mixture 1/8 chi2(0) + 3/8 chi2(1) + 3/8 chi2(2) + 1/8 chi2(3). A marginal likelihood, in which the
# sensitivity is averaged out, gains as much in about exp(-2.7), 7 %, at most.
DRIFTS_95 = 5.4
# Sensitivity of a rate to acceleration: 0.1 deg/s per g (PS-MPU-6000A r3.4, section 6.1), of each axis to each.
SENSITIVITY_SD = np.deg2rad(0.1) / STANDARD_GRAVITY_MPS2


def remove_drift(recording: Recording, flat: Flat, runs: Intervals) -> Recording:
    """Remove the gyroscope's drift and its sensitivity to acceleration: every rest has the flat segment's mean rate.

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
    variance = flat.Sigma_omega / n + tremor * np.minimum(1.0, 2.0 / TREMOR_PER_S * recording.rate_hz / n)
    # As far as gravity turns in a run, its mean rate may be a turn and no bias.
    variance = variance + gravity_turns(recording, runs)[:, None] ** 2
    walk, sensitivity = _smoothed(t, mean, statistics(recording.acc, runs)[0], variance)
    bias = np.stack([np.interp(recording.t, t, column) for column in walk.T], axis=1)
    return replace(recording, gyr=recording.gyr - recording.acc @ sensitivity.T - bias + flat.b_omega)


def _smoothed(t: Vector, mean: Vector, force: Vector, variance: Vector) -> tuple[Vector, Vector]:
    """Smooth random walks (k, 3), measured with a variance (k, 3), each with its most likely density.

    The second value (3, 3) is the likeliest sensitivity to the `force` (k, 3) [m/s^2], or zero: it explains the
    innovations of the rates by those of the force. So the filter runs on both, for all q densities at once: on arrays
    (k, 3, q, 4).
    """
    k, q = len(t), RANDOM_WALKS[:, None]
    values = np.concatenate([mean[:, :, None], np.broadcast_to(force[:, None], (k, 3, 3))], axis=2)[:, :, None]
    m, P = np.empty((k, 3, len(q), 4)), np.empty((k, 3, len(q), 1))
    P_before, S = np.empty((2, k - 1, 3, len(q), 1))
    m[0], P[0] = values[0], variance[0, :, None, None]
    walked = np.diff(t)[:, None, None, None] * q
    for i in range(1, k):
        before = P_before[i - 1] = P[i - 1] + walked[i - 1]
        S[i - 1] = before + variance[i, :, None, None]
        gain = before / S[i - 1]
        m[i], P[i] = m[i - 1] + gain * (values[i] - m[i - 1]), (1.0 - gain) * before
    white = (values[1:] - m[:-1]) / np.sqrt(S)
    cost = np.log(S)[..., 0].sum(axis=0)
    back, filtered = P[:-1] / P_before, m.copy()
    for i in range(k - 2, -1, -1):
        m[i] += back[i] * (m[i + 1] - filtered[i])
    products = np.einsum("kaqi,kaqj->aqij", white, white)
    cost += products[:, :, 0, 0]
    c, N = products[:, :, 1:, 0], products[:, :, 1:, 1:] + np.eye(3) / SENSITIVITY_SD**2
    sensitivity = np.linalg.solve(N, c[..., None])[..., 0]
    with_it = cost - np.sum(sensitivity * c, axis=2) + np.linalg.slogdet(SENSITIVITY_SD**2 * N)[1]
    if np.sum(cost.min(1) - with_it.min(1)) > DRIFTS_95:
        cost = with_it
    else:
        sensitivity[:] = 0.0
    best = np.where(np.sum(cost[:, 0] - cost.min(1)) > DRIFTS_95, cost.argmin(1), 0)
    walk, of_force = np.split(m[:, range(3), best], (1,), axis=2)
    sensitivity = sensitivity[range(3), best]
    return walk[:, :, 0] - np.sum(of_force * sensitivity, axis=2), sensitivity
