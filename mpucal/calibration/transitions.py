"""Transitions between two rests: how far the gyroscope is believed over each.

A real gyroscope errs by more than its noise: by its scale's non-linearity, by steps too long for a fast turn. The rests
on both sides of a transition show by how much.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..data import Vector
from ..kernel import _kernel
from .parameters import NAMES, PLACES
from .preprocessing import POSE_MPS2, Preprocessed
from .rotation import cross, turned
from .static_intervals import statistics
from .theta import Theta

SPEED_OF_TREMOR_S = 0.04  # what a tremor's speed is to its acceleration
FEWEST_TRANSITIONS = 3
DEGREES_OF_FREEDOM = 4.0
# a transition of less weight is weighed down by itself; the others differ by chance
WORTHLESS = 0.02
# of the two that a miss has, what an estimate leaves at least, in all transitions together
LEAST_LEFT = 1.0


class StaticPose(NamedTuple):
    """A rest as the transitions see it.

    first, last : samples of the recording. coming, leaving : (3,) m/s^2, its mean specific force in the body's axes at
    the first and at the last sample. variance : rad^2 an axis, of its direction.
    """

    first: int
    last: int
    coming: Vector
    leaving: Vector
    variance: float


class Transition(NamedTuple):
    """From one rest to the next.

    span : its steps of the series. F : (3, 3) what they do to gravity in the body frame.
    leaving, coming : (3,) m/s^2, gravity at its start and its end. miss : (3,) rad, from where the gyroscope carries
    the one to where the other is. variance : rad^2 an axis, of the miss by noise; of_gyro : the gyroscope's share.
    """

    span: slice
    F: Vector
    leaving: Vector
    coming: Vector
    miss: Vector
    variance: float
    of_gyro: float


def transitions_of(prepared: Preprocessed, theta: Theta) -> list[Transition]:
    """The transitions under theta; none where they are too few to speak for each other."""
    series, flat = prepared.problem.series, prepared.flat
    turns = -series.dt[:, None] * ((series.omega - theta.b_omega) @ theta.K.T)
    rests = _rests(prepared, turns, theta)
    if len(rests) <= FEWEST_TRANSITIONS:
        return []
    transitions = []
    for one, other in pairwise(rests):
        span = slice(one.last - flat.last, other.first + 1 - flat.last)
        F = turned(turns[span])
        miss = _miss(F @ one.leaving, other.coming)
        of_gyro = float(np.sum(series.dt[span] ** 2) * flat.Sigma_omega.mean())
        known = of_gyro + (0.0 if series.q_extra is None else float(series.q_extra[span].sum()))
        variance = known + one.variance + other.variance
        transitions.append(Transition(span, F, one.leaving, other.coming, miss, variance, of_gyro))
    return transitions


def miss_variances(transitions: list[Transition], leverage: Vector | float = 0.0) -> Vector:
    """(k,) rad^2 an axis: the variances with which noise explains all misses.

    z = |miss|^2 / (2 variance). All transitions have a common scale c, the mean of z by Student's t; a lost one has a
    scale of its own.

    leverage : (k,), what the estimate took of the two degrees of freedom of each miss. The likeliest scale, of the
        estimate itself, knows of none; an honest one counts what is left.
    """
    z = np.array([0.5 * float(transition.miss @ transition.miss) / transition.variance for transition in transitions])
    left = max(float(np.sum(2.0 - np.broadcast_to(leverage, len(transitions)))), LEAST_LEFT)
    nu, c = DEGREES_OF_FREEDOM, 1.0
    for _ in range(50):
        w, before = (nu + 2.0) / (nu + 2.0 * z / c), c
        c = max(1.0, 2.0 * float(np.sum(w * z)) / left)
        if c == before:
            break
    weight = (nu + 2.0) / (nu + 2.0 * z / c)
    return c / np.where(weight < WORTHLESS, weight, 1.0) * [transition.variance for transition in transitions]


def q_scale(transitions: list[Transition], variance: Vector, n: int) -> Vector:
    """(n,) factor of Sigma_omega over a series, that gives the misses these variances (k,)."""
    factor = np.ones(n)
    for transition, wanted in zip(transitions, variance.tolist(), strict=True):
        factor[transition.span] += (wanted - transition.variance) / transition.of_gyro
    return factor


def leverages(
    transitions: list[Transition], prepared: Preprocessed, theta: Theta, covariance: Vector, variance: Vector
) -> Vector:
    """(k,) tr(J C J') / variance of each miss, 0 to 2.

    J : (3, p) the miss by the parameters, C : `covariance` (p, p) of theta, which the misses of `variance` (k,) gave.
    """
    inverse = np.asarray(np.linalg.pinv(theta.D))
    J = np.array([_jacobian(transition, prepared, theta, inverse) for transition in transitions])
    taken = np.sum((J @ covariance) * J, axis=(1, 2))
    return np.asarray(np.clip(taken / variance, 0.0, 2.0))


def _jacobian(transition: Transition, prepared: Preprocessed, theta: Theta, inverse: Vector) -> Vector:
    """(3, p) of the miss u x v by the parameters in the order of NAMES, with u and v near each other."""
    series = prepared.problem.series
    steps = series.dt[transition.span, None] * (series.omega[transition.span] - theta.b_omega)
    # phi, the error of the turn in the axes of its end: a step's is -dt dK (omega - b_omega); b_omega the rests tell
    phi = np.zeros((3, len(NAMES)))
    whole, arrived = _kernel.turn(-steps @ theta.K.T, steps)
    by_K = -arrived - np.swapaxes(arrived, 1, 2) * (1.0 - np.eye(3))
    i, j = np.triu_indices(3)
    phi[:, PLACES["K"]] = by_K[:, i, j]
    # s = inv(D) (y - b_a): ds = -inv(D) (dD s + db_a)
    u, v = whole @ transition.leaving, transition.coming
    du, dv = whole @ _by_accelerometer(inverse, transition.leaving), _by_accelerometer(inverse, transition.coming)
    du -= cross(u) @ phi
    return np.asarray((cross(u) @ dv - cross(v) @ du) / (np.linalg.norm(u) * np.linalg.norm(v)))


def _by_accelerometer(inverse: Vector, s: Vector) -> Vector:
    """(3, p) of a measured gravity s by D and b_a."""
    ds = np.zeros((3, len(NAMES)))
    ds[:, PLACES["D"]] = -np.einsum("ki,j->kij", inverse, s).reshape(3, 9)
    ds[:, PLACES["b_a"]] = -inverse
    return ds


def _rests(prepared: Preprocessed, turns: Vector, theta: Theta) -> list[StaticPose]:
    """The flat segment and the rests after it; `turns` (n, 3) rad are the steps of the series."""
    recording, flat = prepared.recording, prepared.flat
    inverse = np.linalg.pinv(theta.D)  # a search may pass through a singular D: that is no reason to stop it
    runs = prepared.runs[prepared.runs[:, 1] > flat.last + 1]
    mean, spread = statistics(recording.acc, runs)
    s, n = (mean - theta.b_a) @ inverse.T, runs[:, 1] - runs[:, 0]
    # a board in a hand turns a little as it rests: each sample counts in the axes of either end
    path = np.cumsum(np.vstack([np.zeros((flat.last + 1, 3)), turns]), axis=0)
    acc = (recording.acc - theta.b_a) @ inverse.T
    across = np.array([_mean_cross(path[a + 1 : b + 1] - path[a], acc[a:b]) for a, b in runs]).reshape(-1, 3)
    coming, leaving = (s + np.cross(path[at] - path[runs[:, 0]], s) - across for at in (runs[:, 0] + 1, runs[:, 1]))
    tremor = np.maximum(np.mean(spread - flat.Sigma_a, axis=1), 0.0)
    of_tremor = 2.0 * tremor * (SPEED_OF_TREMOR_S * recording.rate_hz / n) ** 2
    variance = (POSE_MPS2**2 + flat.Sigma_a.mean() / n + of_tremor) / prepared.problem.gravity**2
    return [StaticPose(*pose) for pose in zip(*runs.T.tolist(), coming, leaving, variance.tolist(), strict=True)]


def _mean_cross(a: Vector, b: Vector) -> Vector:
    """(3,) mean of the cross products of the rows of a and b (n, 3)."""
    M = a.T @ b / len(a)
    return np.array([M[1, 2] - M[2, 1], M[2, 0] - M[0, 2], M[0, 1] - M[1, 0]])


def _miss(carried: Vector, seen: Vector) -> Vector:
    """(3,) sine of the angle between two directions, along their axis."""
    return np.asarray(cross(carried) @ seen / (np.linalg.norm(carried) * np.linalg.norm(seen)))
