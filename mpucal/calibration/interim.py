"""Interim estimate while the board is being turned: D and b_a so far, with their covariance.

It fits the hand's model to means over blocks at 50 Hz, by one search from the last estimate: rougher than a
calibration, and twenty times as fast.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat
from .downsampling import SEARCH_HZ, downsampled
from .hand_noise import CALM_MPS2, FIRST_MPS2, PIVOT_MPS2, WHITE_MPS2, most_likely_sigma
from .hypotheses import nonlinearity
from .initial_estimate import initialise
from .levenberg_marquardt import ROUGHLY, Minimum, information, minimise
from .likelihood import value
from .parameters import ACCELEROMETER, HAND, PLACES
from .preprocessing import CORRELATION_S, FLOOR_MPS2, Preprocessed, preprocess
from .problem import Problem
from .scores import ends_of, parts_of
from .theta import Prior, Theta

MOST_ITERATIONS = 4

# These priors are too weak to change what is measured, and strong enough for a D of which nothing is known yet.
D_SD, B_A_SD_MPS2 = 0.5, 5.0

# A search that settled is compared with other starts when the recording has grown by this factor since.
GROWN = 1.25

# The covariance allows this many times a pivot's travel: more than a calibration's, which compares its parts as well.
DOUBT = 9.0


@dataclass(frozen=True)
class InterimEstimate:
    """Rough estimate, with its problem and covariance.

    Attributes
    ----------
    theta : the estimate. H : (p, p) its Fisher matrix with the prior's. covariance : (12, 12) of D row-major and b_a.
    problem : the series up to now. sigma : m/s^2, of the hand's acceleration while it moves.
    converged : True if the search settled. compared : number of samples when it was last the best of several starts.
    """

    theta: Theta
    H: Vector
    covariance: Vector
    problem: Problem
    sigma: float
    converged: bool
    compared: int

    @property
    def D_std(self) -> Vector:  # noqa: N802 - the paper's letter
        """Standard deviations (3, 3) of D."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance)[PLACES["D"]], 0.0)).reshape(3, 3))

    @property
    def b_a_std(self) -> Vector:
        """Standard deviations (3,) of b_a [m/s^2]."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance)[PLACES["b_a"]], 0.0)))


def interim_estimate(
    recording: Recording, flat: Flat, gravity: float, before: InterimEstimate | None = None
) -> InterimEstimate:
    """Estimate D and b_a from the recording so far.

    The search goes on from `before` if that settled and, compared as the recording grows, no other start fits better;
    else it begins with Huber's loss, which converges from far away.
    """
    prepared = preprocess(*downsampled(recording, flat, SEARCH_HZ), gravity)
    prior = prepared.prior(D=(np.eye(3).ravel(), D_SD), b_a=(0.0, B_A_SD_MPS2))
    rough = replace(prepared.white(FIRST_MPS2), tail=0.0)
    if before is not None and before.converged and len(recording) < GROWN * before.compared:
        theta, compared = before.theta, before.compared
    else:
        starts = (*_starts(prepared), *(() if before is None else (before.theta,)))
        theta, compared = min(starts, key=lambda start: value(rough, start) + prior.cost(start)), len(recording)
    if before is not None and before.converged and theta is before.theta:
        sigma = before.sigma
    else:
        theta = _minimum(rough, theta, prior).theta.right_handed()
        sigma = most_likely_sigma(prepared.white, WHITE_MPS2, theta, FIRST_MPS2)
    problem = prepared.white(sigma, CORRELATION_S)
    minimum = _minimum(problem, theta, prior)
    admitted = problem
    if not prepared.rests_often:
        # With few rests the estimate depends on the hand's travel, of which little is known: admit more of it.
        pivots = partial(prepared.pivot, floor=FLOOR_MPS2)
        pivot = most_likely_sigma(pivots, PIVOT_MPS2, minimum.theta, PIVOT_MPS2[0])
        admitted = prepared.pivot(DOUBT * pivot, FLOOR_MPS2)
    H = information(admitted, minimum.theta, prior)
    covariance, parts = replace(minimum, H=H).covariance(), parts_of(problem, minimum, prior)
    if parts is not None:
        covariance += nonlinearity(parts, minimum.theta.D)
    covariance = covariance[ACCELEROMETER, ACCELEROMETER]
    sigma = most_likely_sigma(prepared.white, CALM_MPS2, minimum.theta, max(sigma, CALM_MPS2[0]))
    return InterimEstimate(minimum.theta, H, covariance, problem, sigma, minimum.converged, compared)


def _starts(prepared: Preprocessed) -> tuple[Theta, ...]:
    """Return a perfect sensor with the bias that the flat mean gives, and the linear estimate."""
    flat = prepared.flat
    u = flat.y / np.linalg.norm(flat.y)
    perfect = Theta.start(np.eye(3), flat.y - prepared.problem.gravity * u, flat.b_omega, u)
    return perfect, initialise(prepared.problem, flat.b_omega)


def _minimum(problem: Problem, theta: Theta, prior: Prior) -> Minimum:
    search = partial(minimise, until=ROUGHLY, most=MOST_ITERATIONS, frozen=True)
    return search(problem, theta, HAND, prior, ends=ends_of(problem))
