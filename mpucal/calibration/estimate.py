"""The estimators, from a recording to a Fit. Knows no verdict."""

from __future__ import annotations

import numpy as np

from ..data import Recording
from .initialise import initialise
from .likelihood import NAMES, Problem, Series
from .masks import mask
from .minimise import Minimum, Prior, minimise
from .model import Fit, Flat


def fit_accel(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """D, b_a, b_omega and the first tilts, with the gyroscope's scale trusted: the paper's model, made efficient."""
    problem = Problem(mask(Series.after(recording, flat), recording, flat), flat, gravity)
    start = initialise(problem, flat.b_omega)
    prior = Prior.of(b_omega=(flat.b_omega, np.sqrt(flat.Sigma_omega / flat.n)))
    return as_fit(minimise(problem, start, 17, prior), len(problem.series))


def as_fit(minimum: Minimum, samples: int) -> Fit:
    """What a minimum says, as every method says it."""
    theta = minimum.theta
    return Fit(
        D=theta.D,
        b_a=theta.b_a,
        b_omega=theta.b_omega,
        K=theta.K,
        names=NAMES[: len(minimum.H)],
        covariance=minimum.covariance(),
        iterations=minimum.iterations,
        converged=minimum.converged,
        nis=minimum.squares / max(samples, 1),
        V=minimum.V,
    )
