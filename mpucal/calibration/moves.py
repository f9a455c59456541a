"""How far the gyroscope is believed between two rests. Knows no minimiser.

A real gyroscope errs by more than its noise: by its scale's non-linearity, by steps too long for a fast turn. The rests
on both sides of a move show by how much.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..data import Recording, Vector
from .likelihood import Series, Theta
from .model import Flat, product, rotation
from .still import Runs

POSE_MPS2 = 0.0003  # no pose is known better than its mounting is stiff
SPEED_OF_TREMOR_S = 0.04  # what a tremor's speed is to its acceleration
FEWEST_MOVES = 3
DEGREES_OF_FREEDOM = 4.0
# a move of less weight is weighed down by itself; the others differ by chance
WORTHLESS = 0.02


class Rest(NamedTuple):
    """A rest as the moves see it.

    first, last : samples of the recording. coming, leaving : (3,) m/s^2, its mean specific force in the body's axes at
    the first and at the last sample. variance : rad^2 an axis, of its direction.
    """

    first: int
    last: int
    coming: Vector
    leaving: Vector
    variance: float


def q_scale_of_moves(
    recording: Recording, flat: Flat, series: Series, theta: Theta, runs: Runs, gravity: float
) -> Vector | None:
    """(n,) factor of Sigma_omega over the series, with which noise explains all moves; None where they are too few.

    The gravity of one rest, carried to the next by the gyroscope, misses it by e; z = |e|^2 / (2 v) with v what noise
    explains. All moves have a common scale c, the mean of z by Student's t; a lost one has a scale of its own.
    """
    turns = -series.dt[:, None] * ((series.omega - theta.b_omega) @ theta.K.T)
    rests = _rests(recording, flat, turns, theta, runs, gravity)
    if len(rests) <= FEWEST_MOVES:
        return None
    F = rotation(turns)
    spans, v, z, noise = [], [], [], []
    for one, other in pairwise(rests):
        span = slice(one.last - flat.last, other.first + 1 - flat.last)
        e = _miss(product(F[span]) @ one.leaving, other.coming)
        of_gyro = float(np.sum(series.dt[span] ** 2) * flat.Sigma_omega.mean())
        known = of_gyro + (0.0 if series.q_extra is None else float(series.q_extra[span].sum()))
        variance = known + one.variance + other.variance
        spans.append(span)
        v.append(variance)
        z.append(0.5 * float(e @ e) / variance)
        noise.append(of_gyro)
    weight, scale = _weights(np.array(z))
    factor = np.ones(len(series))
    for span, w, variance, of_gyro in zip(spans, weight, v, noise, strict=True):
        factor[span] += (scale / (w if w < WORTHLESS else 1.0) - 1.0) * variance / of_gyro
    return factor


def _rests(recording: Recording, flat: Flat, turns: Vector, theta: Theta, runs: Runs, gravity: float) -> list[Rest]:
    """The flat segment and the rests after it; `turns` (n, 3) rad are the steps of the series."""
    inverse = np.linalg.pinv(theta.D)  # a search may pass through a singular D: that is no reason to stop it
    dt = 1.0 / recording.rate_hz
    turns = np.vstack([np.zeros((flat.last, 3)), turns])
    rests = []
    for first, last in runs.tolist():
        if last <= flat.last + 1:
            continue
        acc = recording.acc[first:last]
        s = (acc.mean(0) - theta.b_a) @ inverse.T
        # a board in a hand turns a little as it rests: each sample counts in the axes of either end
        turned = np.cumsum(turns[first:last], axis=0)
        across = _mean_cross(turned, (acc - theta.b_a) @ inverse.T)
        coming, leaving = s - across + np.cross(turned[0], s), s + np.cross(turned[-1], s) - across
        tremor = max(float(np.mean(acc.var(0) - flat.Sigma_a)), 0.0)
        of_tremor = 2.0 * tremor * (SPEED_OF_TREMOR_S / ((last - first) * dt)) ** 2
        variance = (POSE_MPS2**2 + flat.Sigma_a.mean() / (last - first) + of_tremor) / gravity**2
        rests.append(Rest(first, last, coming, leaving, variance))
    return rests


def _mean_cross(a: Vector, b: Vector) -> Vector:
    """(3,) mean of the cross products of the rows of a and b (n, 3)."""
    M = a.T @ b / len(a)
    return np.array([M[1, 2] - M[2, 1], M[2, 0] - M[0, 2], M[0, 1] - M[1, 0]])


def _miss(carried: Vector, seen: Vector) -> Vector:
    """(3,) sine of the angle between two directions, along their axis."""
    return np.cross(carried, seen) / (np.linalg.norm(carried) * np.linalg.norm(seen))


def _weights(z: Vector) -> tuple[Vector, float]:
    """Student-t weights (k,) of the moves, and the scale c >= 1 of the moves that agree."""
    nu, c = DEGREES_OF_FREEDOM, 1.0
    for _ in range(50):
        w = (nu + 2.0) / (nu + 2.0 * z / c)
        c = max(1.0, float(np.mean(w * z)))
    return (nu + 2.0) / (nu + 2.0 * z / c), c
