"""The gyroscope's matrix K: whether an estimate tells it from the identity, and which elements the data determine."""

from __future__ import annotations

import numpy as np

from ..data import Vector
from .levenberg_marquardt import Minimum
from .parameters import BY_NAME, PLACES

K = BY_NAME["K"]

# scipy.stats.chi2.ppf(0.99, 6): below it, K is not told from the identity
WALD_99 = 16.8
# a parameter is known where the data halve what was open before
KNOWN = 0.5


def wald(minimum: Minimum) -> float:
    """k' C_k^-1 k of k = K - I: chi^2 of six degrees of freedom where the gyroscope is perfect."""
    place = PLACES[K.name]
    k = minimum.theta.K[np.triu_indices(3)] - K.mean
    return float(k @ np.linalg.solve(minimum.covariance()[place, place], k))


def at_prior(covariance: Vector) -> tuple[str, ...]:
    """Names of K's elements of which the data say little, by the (p, p) covariance of an estimate that has K."""
    variance = np.diag(covariance)[PLACES[K.name]]
    # a singular covariance may hold a variance that is none
    known = (variance > 0.0) & (variance <= (KNOWN * np.array(K.sd)) ** 2)
    return tuple(name for name, is_known in zip(K.names, known, strict=True) if not is_known)
