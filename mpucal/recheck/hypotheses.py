"""Comparison of hypotheses about a sensor's change, by their evidence, at a given rate of false alarms.

Under hypothesis h, r = J theta + noise is Gaussian with covariance S_h = J P_h J^T + R. The evidence for h against
"nothing" is the ratio of their densities. The sensor has changed if the largest evidence, each times its prior
probability, exceeds that of 99 of 100 draws of "nothing"; the hypothesis of the largest is then the likeliest.
(MacKay, Information Theory, Inference, and Learning Algorithms, 2003, chapter 28, on evidence.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..data import Vector
from ..result.comparison import CONFIDENCE
from .observed import Observations

DRAWS, SEED = 20_000, 1
NOTHING = "nothing"


@dataclass(frozen=True)
class HypothesisOdds:
    """Evidence for each hypothesis.

    Attributes
    ----------
    likeliest : hypothesis; "nothing" unless the evidence for another one is beyond chance.
    probability : share of unchanged sensors that show as much. log_odds : of each hypothesis against "nothing".
    """

    likeliest: str
    probability: float
    log_odds: Mapping[str, float]


def compare_hypotheses(
    observed: Observations, nothing: Vector, hypotheses: Mapping[str, tuple[float, Vector]]
) -> HypothesisOdds:
    """Return the evidence for each hypothesis, and the likeliest.

    Parameters
    ----------
    nothing : (23, 23) covariance of theta of an unchanged sensor.
    hypotheses : the prior probability of each, and the covariance that it adds.
    """
    J, R, r = observed.J, observed.R, observed.r
    root = np.linalg.cholesky(J @ nothing @ J.T + R)
    whitened = np.linalg.solve(root, np.column_stack([r, J]))
    z, W = whitened[:, 0], whitened[:, 1:]
    # Row 0 holds the observations, the others are draws of "nothing".
    rows = np.vstack([z, np.random.default_rng(SEED).standard_normal((DRAWS, len(z)))])
    odds = {name: _log_odds(rows, W, prior, added) for name, (prior, added) in hypotheses.items()}
    largest = np.max(list(odds.values()), axis=0)
    probability = float((1 + np.sum(largest[1:] >= largest[0])) / (1 + DRAWS))
    likeliest = max(odds, key=lambda name: odds[name][0]) if probability < 1.0 - CONFIDENCE else NOTHING
    return HypothesisOdds(likeliest, probability, {name: float(of[0]) for name, of in odds.items()})


def estimate(observed: Observations, P: Vector) -> tuple[Vector, Vector]:
    """Return mean (23,) and covariance (23, 23) of theta given the observations and its prior covariance P."""
    J = observed.J
    gain = np.linalg.solve(J @ P @ J.T + observed.R, J @ P).T
    return gain @ observed.r, P - gain @ J @ P


def p_value(observed: Observations, P: Vector) -> float:
    """Return the probability of observations as unlikely as these, for theta of covariance P (chi-squared test)."""
    from scipy.special import chdtrc  # noqa: PLC0415 - slow to import

    S = observed.J @ P @ observed.J.T + observed.R
    return float(chdtrc(len(observed.r), observed.r @ np.linalg.solve(S, observed.r)))


def _log_odds(rows: Vector, W: Vector, prior: float, added: Vector) -> Vector:
    """Return (n,) log odds, by rows (n, m) whitened under "nothing", of the hypothesis that adds a covariance."""
    values, vectors = np.linalg.eigh(added)
    used = values > 1e-15 * values.max()
    V = W @ (vectors[:, used] * np.sqrt(values[used]))
    if not V.any():  # these observations do not depend on it
        return np.full(len(rows), -math.inf)
    # S_h = I + V V^T
    inner = np.eye(V.shape[1]) + V.T @ V
    projected = rows @ V
    explained = np.einsum("ni,ni->n", projected, np.linalg.solve(inner, projected.T).T)
    return np.asarray(math.log(prior) + 0.5 * (explained - np.linalg.slogdet(inner)[1]))
