"""Whether the sensor stayed the same from start to end, by a score test on means over blocks.

A calibration averages over a mount that slipped or a bias that stepped, and nothing in its covariance shows it. But the
parts of the recording then pull it to different sides.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..data import Recording, Vector
from .downsampling import downsampled
from .fit import Fit
from .flat_segment import Flat
from .hand_noise import PIVOT_MPS2, WHITE_MPS2, farther, likeliest
from .levenberg_marquardt import inverse, minimise
from .likelihood import evaluate
from .parameters import ACCELEROMETER, HAND
from .preprocessing import CORRELATION_S, FLOOR_MPS2, Preprocessed, preprocess
from .prior import prior_of
from .problem import Problem
from .theta import Theta, values

TEST_HZ = 25.0
SHARES = (0.25, 0.5, 0.75)  # of the recording, after which something may have changed
ROUGHLY, MOST_ROUGHLY = 0.05, 3
FEWEST_BLOCKS = 100
# what no sensor changes by: without it, what one part says nothing of would be free
CHANGE_SD = np.repeat([0.5, 5.0], [9, 3])
# what an honest sensor changes by, as it warms
DRIFT_SD = np.repeat([0.003, 0.03], [9, 3])


class Change(NamedTuple):
    """The likeliest change of D and b_a at one of a few times.

    significance : its squared size a parameter, in units of its covariance and of what warming does; 1 by chance.
    t_s : when, in the recording's time. rests_often : whether it was judged by rests, or else by moves.
    """

    significance: float
    t_s: float
    rests_often: bool


def likeliest_change(recording: Recording, flat: Flat, fit: Fit, gravity: float) -> Change | None:
    """The most significant change; None for a recording too short to tell.

    Let D and b_a be theta's before a time and theirs + d after it. One Newton step from d = 0 needs nothing but the
    gradient and the Fisher matrix of the whole and of the part before.
    """
    prepared = preprocess(*downsampled(recording, flat, TEST_HZ), gravity)
    n = len(prepared.problem.series)
    if n < FEWEST_BLOCKS:
        return None
    prior = prior_of(prepared.flat)
    start = _start(fit, prepared)
    problem = _with_noise(prepared, start)
    theta = minimise(problem, start, HAND, prior, until=ROUGHLY, most=MOST_ROUGHLY, frozen=True).theta
    whole = evaluate(problem, theta, HAND)
    gradient = whole.gradient + prior.precision * (values(theta) - prior.mean)
    H = whole.fisher + np.diag(prior.precision)
    changes = []
    for share in SHARES:
        cut = int(share * n)
        before = evaluate(problem.first(cut), theta, HAND)
        of_after, H_after = whole.gradient - before.gradient, whole.fisher - before.fisher
        d, covariance = _newton(H, gradient, H_after[:, ACCELEROMETER], of_after[ACCELEROMETER])
        changes.append(
            Change(
                float(d @ np.linalg.solve(covariance + np.diag(DRIFT_SD**2), d)) / len(d),
                float(prepared.recording.t[prepared.flat.last + cut]),
                prepared.rests_often,
            )
        )
    return max(changes)


def _start(fit: Fit, prepared: Preprocessed) -> Theta:
    """Of the fit, without a lever arm and a delay, which it does not tell."""
    u = np.linalg.solve(fit.D, prepared.flat.y - fit.b_a)
    return replace(Theta.start(fit.D, fit.b_a, prepared.flat.b_omega, u / np.linalg.norm(u)), K=fit.K)


def _with_noise(prepared: Preprocessed, theta: Theta) -> Problem:
    """The likeliest noise of the hand: white from rest to rest, else a pivot's, which a calm one does not need."""
    if prepared.rests_often:
        return prepared.white(likeliest(prepared.white, WHITE_MPS2, theta), CORRELATION_S)
    sigma = likeliest(lambda sigma: prepared.pivot(sigma, FLOOR_MPS2), PIVOT_MPS2, theta)
    return prepared.pivot(farther(sigma), FLOOR_MPS2)


def _newton(H: Vector, gradient: Vector, H_after: Vector, gradient_after: Vector) -> tuple[Vector, Vector]:
    """d (12,) and its covariance, beside theta (p,): H (p, p), and what the part after says of d: (p, 12), (12,)."""
    p = len(H)
    joint = np.block([[H, H_after], [H_after.T, H_after[ACCELEROMETER] + np.diag(CHANGE_SD**-2.0)]])
    covariance = inverse(joint)
    step = -covariance @ np.append(gradient, gradient_after)
    return step[p:], covariance[p:, p:]
