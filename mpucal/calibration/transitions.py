"""Transitions from rest to rest, which measure the gyroscope's error between them.

A real gyroscope errs by more than its noise: by a nonlinear scale, and by steps too long for a fast turn. The rests on
both sides of a transition show by how much.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..data import Vector
from ..rests.intervals import Intervals
from .parameters import NAMES, PLACES
from .preprocessing import Preprocessed
from .problem import Series
from .rotation import cross, cross_rows, lengths, turn_by_matrix, turned
from .theta import Theta

MOST_MISS_RAD = np.deg2rad(7.5)  # of gravity from rest to rest; biases and skew of any sensor make it less
FEWEST_TRANSITIONS = 3  # fewer cannot contradict each other
REWEIGHTED = 8  # iterations of a least squares fit whose weights depend on the residuals
DEGREES_OF_FREEDOM = 4.0  # of Student's t distribution of the misses
# The gyroscope lost a transition of less weight than this. Its variance has a scale of its own, and the others' one.
WORTHLESS = 0.02


class Transition(NamedTuple):
    """Transition from one rest to the next.

    span : its steps of the series. F : (3, 3), rotation by the gyroscope that takes gravity in the body frame from its
    start to its end. leaving, coming : (3,) m/s^2, gravity as measured at its start and its end.
    miss : (3,) rad, rotation from F `leaving` to `coming`. variance : rad^2 an axis, of the miss by known noise;
    of_gyro : the gyroscope's share of it.
    """

    span: slice
    F: Vector
    leaving: Vector
    coming: Vector
    miss: Vector
    variance: float
    of_gyro: float


def transitions_of(prepared: Preprocessed, theta: Theta) -> list[Transition]:
    """Return the transitions under theta; none where they are too few to be compared."""
    series, poses = prepared.problem.series, prepared.poses
    if len(poses.spans) < FEWEST_TRANSITIONS:
        return []
    turns = -series.dt[:, None] * ((series.omega - theta.b_omega) @ theta.K.T)
    coming, leaving = poses.forces(theta)
    F, leaving, coming = turned(turns, _runs(poses.spans)), leaving[:-1], coming[1:]
    # The miss is the sine of the angle between two directions, along their axis.
    carried = np.einsum("kij,kj->ki", F, leaving)
    miss = cross_rows(carried, coming) / (lengths(carried) * lengths(coming))[:, None]
    columns = poses.spans, F, leaving, coming, miss, poses.variance.tolist(), poses.of_gyro.tolist()
    return [Transition(*of) for of in zip(*columns, strict=True)]


def miss_variances(transitions: Sequence[Transition], leverage: Vector | float = 0.0) -> Vector:
    """Return variances (k,) [rad^2 an axis] that explain all misses: the known ones times a common scale, at least 1.

    A lost transition has a scale of its own.

    leverage : (k,), number of degrees of freedom, of the two of each miss, that the estimate has used up. It is 0 for
        the most likely scale, which the estimate itself needs, and not for that of its honest uncertainty.
    """
    known, c, weight = _scales(transitions, leverage)
    return np.asarray(c / np.where(weight < WORTHLESS, weight, 1.0) * known)


def are_explained(transitions: Sequence[Transition]) -> bool:
    """Return True if the known noise explains the misses, those of lost transitions excepted."""
    return not transitions or bool(_scales(transitions, 0.0)[1] == 1.0)


def each_variance(transitions: Sequence[Transition]) -> tuple[Vector, Vector]:
    """Return the variance (k,) [rad^2 an axis] of each miss, as the gyroscope's error beyond its noise varies.

    The error is distributed by Student's t. So a transition in which the sensor met the table may miss by several times
    what the others do, and needs no change of the sensor as an explanation.

    The second value (k,) is the factor by which the weight of the acceleration is reduced in each transition. Otherwise
    the acceleration alone would decide how the board turned, as it may where the gyroscope lost it: there it is 1.
    """
    known, c, weight = _scales(transitions, 0.0)
    return (1.0 + (c - 1.0) / weight) * known, np.where(weight < WORTHLESS, 1.0, np.minimum(weight, 1.0))


def _scales(transitions: Sequence[Transition], leverage: Vector | float) -> tuple[Vector, Vector, Vector]:
    """Return the known variances (k,) of the misses, their common scale (1,) and their weights (k,)."""
    miss, known = (np.array([getattr(of, name) for of in transitions]) for name in ("miss", "variance"))
    return known, *likely_scale(miss, known, leverage)


def likely_scale(miss: Vector, known: Vector, leverage: Vector | float = 0.0) -> tuple[Vector, Vector]:
    """Return the common scale (..., 1), at least 1, by which misses (..., k, 3) exceed their variances `known` (k,).

    It is the mean of z = |miss|^2 / (2 variance) by Student's t. The second value (..., k) are the weights of misses.
    """
    z = 0.5 * np.sum(miss * miss, axis=-1) / known
    left = max(float(np.sum(2.0 - np.broadcast_to(leverage, len(known)))), 1.0)
    nu, c = DEGREES_OF_FREEDOM, np.ones((*z.shape[:-1], 1))
    for _ in range(50):
        # Newton's method: this falls with c and is convex, so that steps from below do not pass the root.
        share = z / (nu * c + 2.0 * z)
        above = share.sum(axis=-1, keepdims=True) - 0.5 * left / (nu + 2.0)
        slope = (share * nu / (nu * c + 2.0 * z)).sum(axis=-1, keepdims=True)
        step = np.divide(above, slope, out=np.zeros_like(c), where=above > 0.0)
        c = c + step
        if (step < 1e-6 * c).all():
            break
    return c, (nu + 2.0) / (nu + 2.0 * z / c)


def q_scale(transitions: Sequence[Transition], variance: Vector, n: int) -> Vector:
    """Return the factor (n,) of Sigma_omega over a series that gives the misses these variances (k,)."""
    more = [(wanted - of.variance) / of.of_gyro for of, wanted in zip(transitions, variance.tolist(), strict=True)]
    return 1.0 + over_spans(transitions, more, n)


def over_spans(transitions: Sequence[Transition], values: Sequence[float], n: int) -> Vector:
    """Return (n,) the values of k transitions over a series, and 0 between them."""
    over = np.zeros(n)
    for transition, value in zip(transitions, values, strict=True):
        over[transition.span] = value
    return over


def leverages(
    transitions: Sequence[Transition], prepared: Preprocessed, theta: Theta, covariance: Vector, variance: Vector
) -> Vector:
    """Return tr(J C J') / variance (k,) of each miss, 0 to 2.

    J (3, p) are the derivatives of the miss, C is the covariance (p, p) of theta from a fit with `variance` (k,).
    """
    J = jacobians(transitions, prepared.problem.series, theta)
    taken = np.sum((J @ covariance) * J, axis=(1, 2))
    return np.asarray(np.clip(taken / variance, 0.0, 2.0))


def _runs(spans: Sequence[slice]) -> Intervals:
    return np.array([(span.start, span.stop) for span in spans], np.intp)


def jacobians(transitions: Sequence[Transition], series: Series, theta: Theta) -> Vector:
    """Return derivatives (k, 3, p) of the misses in the order of NAMES, as the rests determine b_omega."""
    steps = series.dt[:, None] * (series.omega - theta.b_omega)
    F, phi = turn_by_matrix(steps, theta.K, _runs([of.span for of in transitions]))
    leaving, coming = (np.array([getattr(of, name) for of in transitions]) for name in ("leaving", "coming"))
    return miss_jacobians(F, leaving, coming, theta.inverse, phi)


def miss_jacobians(F: Vector, leaving: Vector, coming: Vector, inverse: Vector, phi: Vector) -> Vector:
    """Return derivatives (k, 3, p) of the misses u x v in the order of NAMES, with u and v near each other.

    inverse : (3, 3), that of D. phi : (k, 3, 6), see turn_by_matrix.
    """
    u = np.einsum("kij,kj->ki", F, leaving)
    du = F @ by_accelerometer(inverse, leaving)
    du[:, :, PLACES["K"]] -= cross(u) @ phi
    J = cross(u) @ by_accelerometer(inverse, coming) - cross(coming) @ du
    return np.asarray(J / (lengths(u) * lengths(coming))[:, None, None])


def by_accelerometer(inverse: Vector, s: Vector) -> Vector:
    """Return derivatives (k, 3, p) of gravities s = inv(D) (y - b_a) (k, 3): ds = -inv(D) (dD s + db_a)."""
    ds = np.zeros((len(s), 3, len(NAMES)))
    ds[:, :, PLACES["D"]] = -np.einsum("ai,kj->kaij", inverse, s).reshape(-1, 3, 9)
    ds[:, :, PLACES["b_a"]] = -inverse
    return ds
