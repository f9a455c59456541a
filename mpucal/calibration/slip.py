"""Slip of the mount between two rests, or within one of the last: from then on, gravity contradicts the gyroscope.

The miss of a transition is the angle by which gravity, carried by the gyroscope from one rest, misses gravity as
measured in the next. A fit takes large misses for errors of the gyroscope, and its uncertainties grow. But a mount that
slipped leaves a pattern: one rotation of the accelerometer relative to the gyroscope before the slip, and another one
after it, explain all misses. The BIC decides whether they do. Within a rest the gyroscope hardly errs, and a slip shows
as a turn of gravity between the halves of that rest alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.linalg import norm
from numpy.typing import NDArray

from ..data import Mask, Vector
from ..rests.intervals import SHORTEST_S, statistics
from ..rests.tremor import SWAY_PER_S, level_rests, mean_variance, tremor_variance
from .hypotheses import SURE
from .parameters import PLACES
from .poses import POSE_MPS2
from .preprocessing import Preprocessed
from .problem import Series
from .rotation import cross, lengths
from .theta import Theta
from .transitions import (
    DEGREES_OF_FREEDOM,
    FEWEST_TRANSITIONS,
    REWEIGHTED,
    Transition,
    jacobians,
    likely_scale,
)


class Slip(NamedTuple):
    """Slip of the mount.

    span : (2,) s after the flat segment, between which it happened. delta : (3,) rad, rotation of the accelerometer.
    transitions : all of them, with the misses that remain after the slip.
    near_end : True in the first or last two transitions: too little was recorded before, or after, to see the change.
    """

    span: tuple[float, float]
    delta: Vector
    transitions: Sequence[Transition]
    near_end: bool = False


def find_slip(
    transitions: Sequence[Transition], prepared: Preprocessed, theta: Theta, spoilt: Mask
) -> tuple[Slip | None, Vector]:
    """Return the slip that is certain, or None, and the variances (12,) of D and b_a by slips that are possible.

    Near the ends of the recording, a miss that is hardly by chance is taken for a slip. spoilt : see end_slips.
    """
    t = np.concatenate([[0.0], np.cumsum(prepared.problem.series.dt)])
    ends = [*zip(end_slips(transitions, spoilt).tolist(), transitions, strict=True), *_at_rest(prepared, theta, spoilt)]
    squares = sum((chance * slip_squares(each, theta.D) for chance, each in ends), np.zeros(12))
    probability, slipped = max(ends, key=lambda end: end[0], default=(0.0, None))
    if slipped is not None and probability > 0.5:
        left = [each._replace(miss=np.zeros(3)) if each is slipped else each for each in transitions]
        return Slip(_times(t, slipped), slipped.miss, left, near_end=True), squares
    return _between_rests(transitions, prepared.problem.series, theta, t), squares


def _between_rests(transitions: Sequence[Transition], series: Series, theta: Theta, t: Vector) -> Slip | None:
    """Return the slip that explains the misses of transitions between rests under theta, or None.

    K is estimated again, with the slip and without, since a K that was estimated without it explains much of it.
    """
    k, (n, p) = len(transitions), _numbers(transitions)
    if n <= p:
        return None
    # What the slip must gain: odds, three numbers and the choice of a time; more if there are hardly enough misses.
    cost = (math.log(SURE) + 1.5 * math.log(n) + math.log(k)) * n / (n - p)
    misses, known = (np.array([getattr(each, name) for each in transitions]) for name in ("miss", "variance"))
    # A slip gains at most the log likelihood's distance from 0, its value for no misses at all.
    if not -_log_likelihood(misses, known) > cost:
        return None
    places = np.arange(2, k - 2)  # a rotation has three numbers, and each transition shows two of them
    by_slip = _directions(transitions, np.append(places, k))
    by_K = np.broadcast_to(jacobians(transitions, series, theta)[:, :, PLACES["K"]], by_slip.shape)
    likelihood, x, left = _likeliest(misses, known, np.concatenate([by_slip, by_K], axis=3))
    best = int(likelihood[:-1].argmax())
    if not likelihood[best] > likelihood[-1] + cost:
        return None
    without = [each._replace(miss=miss) for each, miss in zip(transitions, left[best], strict=True)]
    return Slip(_times(t, transitions[places[best]]), x[best, 3:6] - x[best, :3], without)


def end_slips(transitions: Sequence[Transition], spoilt: Mask) -> Vector:
    """Return probabilities (k,) of a slip in each transition; 0 but for the first and last two.

    There a slip leaves no pattern, and looks like a turn that the gyroscope missed. A miss that the next transition
    undoes does not count: it is an error of the rest between them.

    spoilt : (n,) True for samples whose rates are lost or clipped; the transitions that have some are left out.
    """
    n, p = _numbers(transitions)
    if n <= p:
        return np.zeros(len(transitions))
    known = np.array([each.variance for each in transitions])
    return _probability(_lasting(transitions), known) * [not spoilt[each.span].any() for each in transitions]


def _at_rest(prepared: Preprocessed, theta: Theta, spoilt: Mask) -> list[tuple[float, Transition]]:
    """Return the probability and the transition of a slip within each of the last two rests; none if rests are too few.

    Between the halves of a rest, gravity misses the turn that the gyroscope shows, because of the hand's sway. The miss
    in each of these two rests is compared with those in equally long parts of the others. spoilt : see end_slips.
    """
    recording, flat, runs = prepared.recording, prepared.flat, prepared.runs
    # each half is long enough for a rest
    runs = runs[(runs[:, 0] > flat.last) & (runs[:, 1] - runs[:, 0] >= 2.0 * SHORTEST_S * recording.rate_hz)]
    if len(runs) < FEWEST_TRANSITIONS:
        return []
    acc, found = level_rests(recording.acc, recording, flat, runs), []
    sway = np.median(tremor_variance(statistics(acc, runs)[1], flat.Sigma_a))
    for at in (-2, -1):
        span, first = slice(*(runs[at] - flat.last).tolist()), runs[:, 0]
        last = np.minimum(runs[:, 1], first + runs[at, 1] - runs[at, 0])
        middle = (first + last) // 2
        leaving, coming = (
            (statistics(acc, np.column_stack(half))[0] - theta.b_a) @ theta.inverse.T
            for half in ((first, middle), (middle, last))
        )
        misses = np.cross(leaving, coming) / (lengths(leaving) * lengths(coming))[:, None]
        n = 0.5 * (last - first)
        of_mean = POSE_MPS2**2 + flat.Sigma_a.mean() / n + sway * mean_variance(SWAY_PER_S * n / recording.rate_hz)
        known = 2.0 * of_mean / prepared.problem.gravity**2
        within = Transition(span, np.eye(3), leaving[at], coming[at], misses[at], float(known[at]), 0.0)
        if not spoilt[span].any():
            found.append((float(_probability(misses, known)[at]), within))
    return found


def slip_squares(transition: Transition, D: Vector) -> Vector:
    """Return mean squares (12,) of the changes of D and b_a by the slip that explains the miss of a transition.

    The miss does not show the rotation about gravity, which is taken to be as large as that about any other axis.
    """
    seen = D @ cross(transition.miss)
    unseen = D @ cross(transition.coming / norm(transition.coming)) * norm(transition.miss) / math.sqrt(2.0)
    return np.append(seen**2 + unseen**2, (seen @ transition.coming) ** 2)


def _probability(misses: Vector, known: Vector) -> Vector:
    """Return probabilities (k,) that misses (k, 3) are by slips and not by chance; 0 but for the first and last two.

    One of SURE recordings has a slip in one of these four places. Without one, a miss as large has the chance that
    Student's t gives. known : (k,) their variances, but for a common scale.
    """
    nu, probability = DEGREES_OF_FREEDOM, np.zeros(len(misses))
    ends = [0, 1, len(misses) - 2, len(misses) - 1]
    chance = (likely_scale(misses, known)[1][ends] * nu / (nu + 2.0)) ** (0.5 * nu)
    probability[ends] = 1.0 / (1.0 + SURE * len(ends) * chance)
    return probability


def _lasting(transitions: Sequence[Transition]) -> Vector:
    """Return the misses (k, 3), or those of two transitions together, wherever that is less."""
    misses = np.array([each.miss for each in transitions])
    both = misses[1:] + [each.F @ before for each, before in zip(transitions[1:], misses, strict=False)]
    far = np.full((1, 3), np.inf)
    of_all = np.array([misses, np.concatenate([far, both]), np.concatenate([both, far])])
    return np.asarray(of_all[norm(of_all, axis=2).argmin(axis=0), np.arange(len(misses))])


def _numbers(transitions: Sequence[Transition]) -> tuple[int, int]:
    """Return how many numbers the misses show; and those of K, and of a rotation before a slip and after it."""
    return 2 * len(transitions), 12


def _times(t: Vector, transition: Transition) -> tuple[float, float]:
    """Return when a transition begins and ends, by the times (n + 1,) of a series' samples."""
    return float(t[transition.span.start]), float(t[transition.span.stop])


def _directions(transitions: Sequence[Transition], places: NDArray[np.intp]) -> Vector:
    """Return derivatives (m, k, 3, 6) of the misses by the rotation before a slip, and after it.

    places : (m,) numbers of the transitions in which it may be; that after the last stands for no slip.
    """
    v = np.array([each.coming for each in transitions])
    v /= lengths(v)[:, None]
    P = np.eye(3) - v[:, :, None] * v[:, None, :]  # a rotation about gravity is no miss
    PF = P @ [each.F for each in transitions]
    k, at = np.arange(len(v)), places[:, None]
    after_start, after_end = (k > at)[..., None, None], (k >= at)[..., None, None]
    return np.concatenate([P * ~after_end - PF * ~after_start, P * after_end - PF * after_start], axis=3)


def _likeliest(misses: Vector, known: Vector, A: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the largest log likelihoods (m,) of misses + A x, with A (m, k, 3, p), these x (m, p), and what is left
    of the misses (m, k, 3).
    """
    left = misses
    for _ in range(REWEIGHTED):
        weight = likely_scale(left, known)[1]
        weighted = (A * (weight / known)[..., None, None]).reshape(len(A), -1, A.shape[3]).swapaxes(1, 2)
        N = weighted @ A.reshape(len(A), -1, A.shape[3])
        x = -(np.linalg.pinv(N, hermitian=True) @ (weighted @ misses.ravel())[..., None])
        left = misses + (A @ x[:, None])[..., 0]
    return _log_likelihood(left, known), x[..., 0], left


def _log_likelihood(misses: Vector, known: Vector) -> Vector:
    """Return the log likelihood (...) of misses (..., k, 3) of `known` variances (k,), by Student's t of one scale."""
    c, nu = likely_scale(misses, known)[0], DEGREES_OF_FREEDOM
    z = 0.5 * np.sum(misses**2, axis=-1) / known
    return np.asarray(-np.sum(np.log(c) + 0.5 * (nu + 2.0) * np.log1p(2.0 * z / (c * nu)), axis=-1))
