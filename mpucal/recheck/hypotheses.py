"""Which of several things happened to a sensor: by evidence, with false alarms at a chosen rate.

Under hypothesis h, r = J theta + noise is Gaussian with covariance S_h = J P_h J^T + R. The evidence for h against
nothing is the ratio of its density to that of h = nothing. Something happened where the largest of these, each times
how often it happens, is beyond what it is in 99 of 100 draws of "nothing"; then the hypothesis of the largest is told.
(MacKay, Information Theory, Inference, and Learning Algorithms, 2003, chapter 28, on evidence.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..data import Vector
from .observed import Observed

FALSE_ALARMS = 0.01
DRAWS, SEED = 20_000, 1
NOTHING = "nothing"


@dataclass(frozen=True)
class Weighed:
    """What the evidence says.

    Attributes
    ----------
    told : the likeliest hypothesis; "nothing" unless the rest of them is beyond chance.
    probability : how often an unchanged sensor would show as much. log_odds : of each hypothesis against nothing.
    """

    told: str
    probability: float
    log_odds: Mapping[str, float]


def weigh(observed: Observed, nothing: Vector, happenings: Mapping[str, tuple[float, Vector]]) -> Weighed:
    """What happened.

    Parameters
    ----------
    nothing : (21, 21) covariance of theta of a sensor to which nothing happened.
    happenings : of each, how often it happens, and the covariance that it adds.
    """
    J, R, r = observed.J, observed.R, observed.r
    root = np.linalg.cholesky(J @ nothing @ J.T + R)
    whitened = np.linalg.solve(root, np.column_stack([r, J]))
    z, W = whitened[:, 0], whitened[:, 1:]
    # row 0 is what was observed, the others are draws of nothing
    rows = np.vstack([z, np.random.default_rng(SEED).standard_normal((DRAWS, len(z)))])
    odds = {name: _log_odds(rows, W, often, added) for name, (often, added) in happenings.items()}
    largest = np.max(list(odds.values()), axis=0)
    probability = float((1 + np.sum(largest[1:] >= largest[0])) / (1 + DRAWS))
    told = max(odds, key=lambda name: odds[name][0]) if probability < FALSE_ALARMS else NOTHING
    return Weighed(told, probability, {name: float(of[0]) for name, of in odds.items()})


def estimate(observed: Observed, P: Vector) -> tuple[Vector, Vector]:
    """(21,) mean and (21, 21) covariance of theta, given what was observed; P is its covariance beforehand."""
    J = observed.J
    gain = np.linalg.solve(J @ P @ J.T + observed.R, J @ P).T
    return gain @ observed.r, P - gain @ J @ P


def fits(observed: Observed, P: Vector) -> float:
    """How often a theta of covariance P shows what is as unlikely as what was observed."""
    from scipy.stats import chi2  # noqa: PLC0415 - slow to import

    S = observed.J @ P @ observed.J.T + observed.R
    return float(chi2.sf(observed.r @ np.linalg.solve(S, observed.r), len(observed.r)))


def _log_odds(rows: Vector, W: Vector, often: float, added: Vector) -> Vector:
    """(n,) logarithm of the evidence of each row (n, m), whitened under "nothing", for what adds a covariance."""
    values, vectors = np.linalg.eigh(added)
    used = values > 1e-15 * values.max()
    V = W @ (vectors[:, used] * np.sqrt(values[used]))
    # S_h = I + V V^T
    inner = np.eye(V.shape[1]) + V.T @ V
    projected = rows @ V
    explained = np.einsum("ni,ni->n", projected, np.linalg.solve(inner, projected.T).T)
    return np.asarray(math.log(often) + 0.5 * (explained - np.linalg.slogdet(inner)[1]))
