"""Rao's score test of a lever arm, at the estimate of a model of a sensor that turns in place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat
from .levenberg_marquardt import Minimum
from .likelihood import evaluate
from .parameters import HAND, PLACES
from .preprocessing import rates
from .prior import Prior
from .problem import Problem

CHI2 = 30.7  # of three degrees of freedom; one in a million is beyond it by chance
LEAST_M = 1e-3  # the axes of one chip are as far from each other


def lever_arm(problem: Problem, recording: Recording, flat: Flat, minimum: Minimum, prior: Prior) -> Vector | None:
    """The lever arm r (3,) [m] that the data show beyond chance; None where the sensor turns in place.

    The statistic is g' S^-1 g: g is the gradient by r at r = 0 and S its information, both less what the parameters of
    the estimate take of them. S^-1 g is the first step to r.

    Parameters
    ----------
    problem : of the recording, whose flat segment is `flat`. minimum : of a model without a lever arm.
    """
    n = len(problem.series)
    rate, alpha = rates(recording, flat)
    of_a_hand = replace(
        problem.series, rate=rate, alpha=alpha, reset=np.full(n, -1.0), jerk=np.zeros(n), r_extra=np.zeros(n)
    )
    at = evaluate(replace(problem, series=of_a_hand), minimum.theta, HAND)
    r, others = np.arange(HAND)[PLACES["r"]], np.flatnonzero(minimum.free)
    H = at.fisher[np.ix_(others, others)] + np.diag(prior.precision[others])
    taken = np.linalg.solve(H, at.fisher[np.ix_(others, r)])
    S = at.fisher[np.ix_(r, r)] - at.fisher[np.ix_(r, others)] @ taken
    g = at.gradient[r] - taken.T @ at.gradient[others]
    step = np.linalg.lstsq(S, g, rcond=None)[0]
    return np.asarray(-step) if g @ step > CHI2 and np.linalg.norm(step) > LEAST_M else None
