"""What is known of a gyroscope before it is measured, and whether a measurement adds to it. Knows no filter."""

from __future__ import annotations

import numpy as np

from ..data import Vector
from .levenberg_marquardt import Minimum
from .parameters import K_NAMES, PLACES
from .prior import K_MEAN, K_SD

# chi^2 of six degrees of freedom at 99 %: below it, K is not told from the identity
WALD_99 = 16.8
# a parameter is known where the data halve what was open before
KNOWN = 0.5


def wald(minimum: Minimum) -> float:
    """k' C_k^-1 k of k = K - I: chi^2 of six degrees of freedom where the gyroscope is perfect."""
    place = slice(*PLACES["K"])
    k = minimum.theta.K[np.triu_indices(3)] - K_MEAN
    return float(k @ np.linalg.solve(minimum.covariance()[place, place], k))


def at_prior(covariance: Vector) -> tuple[str, ...]:
    """Names of K's elements of which the data say little, by the (p, p) covariance of an estimate that has K."""
    variance = np.diag(covariance)[slice(*PLACES["K"])]
    # a singular covariance may hold a variance that is none
    known = (variance > 0.0) & (variance <= (KNOWN * K_SD) ** 2)
    return tuple(name for name, is_known in zip(K_NAMES, known, strict=True) if not is_known)
