"""The law of a hand's rest: how an acceleration that trembles and sways is spread over time.

A hand that holds still trembles at 4 to 12 Hz and sways below 1 Hz. Its acceleration is that of a position that three
poles at lambda keep bounded (docs/method.md, equation 13). Its size is a rest's own; lambda is the recording's, and
says how much of the acceleration a mean over a rest still holds.
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
TREMBLES = 0.04  # a variance below this share of the sensor's noise is none


def tremor_variance(variance: Vector, noise: Vector) -> float:
    """(m/s^2)^2 by which a rest of that variance (3,) trembles beyond noise (3,); 0 of a board that lies."""
    tremor = float(np.mean(variance - 1.05 * noise))
    return tremor if tremor > TREMBLES * float(noise.mean()) else 0.0


def mean_variance(x: Vector) -> Vector:
    """The variance of a mean over T, as a share of the acceleration's; x = lambda T.

    The acceleration's autocovariance at a lag of t is exp(-u) (1 - 5 u / 3 + u^2 / 3) of its variance, u = lambda t.
    """
    return np.asarray(2.0 / (3.0 * x * x) * (1.0 - (1.0 + x - x * x) * np.exp(-x)))


def carried(recording: Recording, flat: Flat, runs: Intervals) -> Vector:
    """(n, 3) m/s^2 the acceleration, in each run carried by the gyroscope into the axes of the run's middle.

    A slow turn of the hand moves gravity through the sensor's axes, and is no acceleration of the hand.
    """
    acc = recording.acc.copy()
    steps = np.diff(recording.t, prepend=recording.t[0])[:, None] * (recording.gyr - flat.b_omega)
    path = np.cumsum(steps, axis=0)
    # all runs at once, of which there are many
    lengths = runs[:, 1] - runs[:, 0]
    begins = np.cumsum(lengths) - lengths
    at = np.arange(lengths.sum()) + np.repeat(runs[:, 0] - begins, lengths)
    phi = path[at] - path[np.repeat((runs[:, 0] + runs[:, 1]) // 2, lengths)]
    once = np.cross(phi, acc[at])
    acc[at] += once + 0.5 * np.cross(phi, once)
    return acc


def fit_lambda(acc: Vector, recording: Recording, flat: Flat, runs: Intervals, otherwise: float) -> float:
    """Lambda [1/s], by what means over blocks keep of the acceleration's variance in the rests of a hand.

    acc : (n, 3) as `carried` gives it. otherwise : where too few rests tremble to tell.
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
