"""Tremor of a hand at rest: its variance, and its spectrum by one parameter lambda.

A hand that holds still trembles at 4 to 12 Hz and sways below 1 Hz. Its acceleration is that of a position that three
poles at lambda keep bounded (docs/method.md, equation 13). Each rest has a size of its own; lambda belongs to the
recording, and gives the share of the acceleration's variance that a mean over a rest keeps.
"""

from __future__ import annotations

import numpy as np

from ..data import Recording, Vector
from .flat import Flat
from .intervals import Intervals

BLOCK_S = 0.4
FEWEST_RESTS = 3
QUICKEST_PER_S, SLOWEST_PER_S = 44.0, 3.0  # a tremor of 10 Hz alone; a sway of 0.7 Hz
LAMBDAS = np.geomspace(QUICKEST_PER_S, SLOWEST_PER_S, 28)
TREMBLES = 0.04  # a tremor's variance below this share of the sensor's noise counts as zero


def tremor_variance(variance: Vector, noise: Vector) -> float:
    """Return the tremor's variance [(m/s^2)^2] in a rest of `variance` (3,), beyond noise (3,); 0 of a still board."""
    tremor = float(np.mean(variance - 1.05 * noise))
    return tremor if tremor > TREMBLES * float(noise.mean()) else 0.0


def mean_variance(x: Vector) -> Vector:
    """Return the variance of a mean over T as a share of the acceleration's; x = lambda T.

    The acceleration's autocovariance at a lag of t is exp(-u) (1 - 5 u / 3 + u^2 / 3) of its variance, u = lambda t.
    """
    return np.asarray(2.0 / (3.0 * x * x) * (1.0 - (1.0 + x - x * x) * np.exp(-x)))


def level_rests(recording: Recording, flat: Flat, runs: Intervals) -> Vector:
    """Return the acceleration (n, 3) [m/s^2], in each run rotated by the gyroscope into the axes of the run's middle.

    Otherwise a slow turn of the hand, which moves gravity through the axes, would pass for an acceleration of the hand.
    """
    acc = recording.acc.copy()
    steps = np.diff(recording.t, prepend=recording.t[0])[:, None] * (recording.gyr - flat.b_omega)
    path = np.cumsum(steps, axis=0)
    # All runs are rotated at once, since there are many.
    lengths = runs[:, 1] - runs[:, 0]
    begins = np.cumsum(lengths) - lengths
    at = np.arange(lengths.sum()) + np.repeat(runs[:, 0] - begins, lengths)
    phi = path[at] - path[np.repeat((runs[:, 0] + runs[:, 1]) // 2, lengths)]
    once = np.cross(phi, acc[at])
    acc[at] += once + 0.5 * np.cross(phi, once)
    return acc


def fit_lambda(acc: Vector, recording: Recording, flat: Flat, runs: Intervals, otherwise: float) -> float:
    """Return lambda [1/s] by the share of the acceleration's variance that means over blocks keep in a hand's rests.

    acc : (n, 3) as `level_rests` returns it. otherwise : returned where too few rests tremble.
    """
    n = max(round(BLOCK_S * recording.rate_hz), 2)
    kept, seconds = [], []
    for first, last in runs.tolist():
        blocks = (last - first) // n
        if last <= flat.last or blocks < 2:
            continue
        rest = acc[first : first + blocks * n]
        variance = tremor_variance(rest.var(0), flat.Sigma_a)
        if not variance:
            continue
        noise = flat.Sigma_a / n * (blocks - 1) / blocks
        kept.append(float(np.mean(rest.reshape(blocks, n, 3).mean(1).var(0) - noise)) / variance)
        seconds.append(blocks * n / recording.rate_hz)
    if len(kept) < FEWEST_RESTS:
        return otherwise
    expected = mean_variance(LAMBDAS * n / recording.rate_hz) - mean_variance(np.outer(seconds, LAMBDAS)).mean(0)
    enough = np.flatnonzero(expected >= np.mean(kept))
    return float(LAMBDAS[enough[0] if len(enough) else -1])
