"""Noise coefficients from an Allan variance: white noise, bias instability, random walk, quantisation, with intervals.

    AVAR(tau) = N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3 + 3 Q^2 / tau^2

(IEEE Std 952, annex C: N, B, K, Q), with N in units/sqrt(Hz) of a two-sided density; a data sheet's one-sided density
is sqrt(2) N. AVAR is linear in the four squares, which are not negative: non-negative least squares, weighted by the
covariance of the variances at all octaves, which follows from the noise itself:

    Cov(AVAR_i, AVAR_j) = 2/n integral of S(f)^2 |H_i(f)|^2 |H_j(f)|^2 df
    |H_m|^2 = 2 sin^4(pi m f) / (m^2 sin^2(pi f))

as for wavelet variances (Percival, Biometrika 1995; Guerrier et al., JASA 2013). Time is in samples until the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Vector

CONFIDENCE = 0.95
# an octave with fewer non-overlapping differences has almost no information
LEAST_CLUSTERS = 5.0
# octaves that may be left out, since a sensor's low-pass filter removes white noise at the shortest times
MOST_LEFT_OUT = 7
# a more probable fit is accepted
LEAST_PROBABILITY = 1e-3
# iterations of the weights; share of the diagonal that stays in them
ITERATIONS, LEAST_SHARE = 6, 1e-4


@dataclass(frozen=True)
class Coefficients:
    """Coefficients N, B, K and Q of one axis, (4,), with their intervals."""

    value: Vector
    low: Vector
    high: Vector


def fit_coefficients(
    sizes: Vector, variances: Vector, samples: int, step_s: float, confidence: float = CONFIDENCE
) -> Coefficients | None:
    """Return the coefficients of (k,) Allan variances at (k,) sizes in samples; None if there are too few octaves.

    Parameters
    ----------
    step_s : sample period [s]; the results are in units/sqrt(Hz), units, units/sqrt(s) and units s.
    confidence : of the intervals.
    """
    used = (sizes <= samples / LEAST_CLUSTERS) & (variances > 0.0)
    sizes, variances = sizes[used], variances[used]
    best: _Fit | None = None
    for first in range(min(MOST_LEFT_OUT, max(len(sizes) - 5, 0)) + 1):
        if len(sizes) - first < 4:
            break
        fit = _Fit(sizes[first:], variances[first:], samples, terms=3 if first else 4)
        if best is None or fit.probability > best.probability:
            best = fit
        if fit.probability > LEAST_PROBABILITY:
            break
    if best is None:
        return None
    units = np.array([step_s, 1.0, 1.0 / step_s, step_s**2])
    found = np.full((3, 4), np.nan)
    for i in range(len(best.squares)):
        found[:, i] = best.unbiased(i), *best.interval(i, confidence)
    value, low, high = np.sqrt(found * units)
    return Coefficients(value, low, high)


def design_matrix(sizes: Vector) -> Vector:
    """Return (k, 4): the Allan variance at sizes (k,) per square of each coefficient, in samples."""
    m = np.asarray(sizes, float)
    flicker = np.full(len(m), 2.0 * math.log(2.0) / math.pi)
    return np.stack([1.0 / m, flicker, m / 3.0 + 1.0 / (6.0 * m), 3.0 / m**2], axis=1)


class _Fit:
    """Fit of the squares (terms,) of the coefficients, and the probability of variances as unlikely as these."""

    def __init__(self, sizes: Vector, variances: Vector, samples: int, terms: int) -> None:
        from scipy.optimize import nnls  # noqa: PLC0415 - slow to import
        from scipy.special import chdtrc  # noqa: PLC0415

        self._A = design_matrix(sizes)[:, :terms]
        # covariance of independent octaves: the start, and a floor for noise of other kinds
        self._independent = np.diag(2.0 * variances**2 * sizes / samples)
        self._products = _products(sizes, samples)[:terms, :terms]
        self._scale = variances[0] / np.abs(self._A).max(0)
        C = self._independent
        for _ in range(ITERATIONS):
            root = np.linalg.cholesky(C + LEAST_SHARE * self._independent)
            W, w = np.linalg.solve(root, self._A * self._scale), np.linalg.solve(root, variances)
            self.squares = self._scale * nnls(W, w)[0]
            C = np.einsum("a,b,abij->ij", self.squares, self.squares, self._products)
        left = w - W @ (self.squares / self._scale)
        self.probability = float(chdtrc(max(len(sizes) - terms, 1), left @ left))

    def unbiased(self, i: int) -> float:
        """Return square i, corrected so that the mean of its root is unbiased.

        The curvature of the root lowers its mean by an eighth of the square's relative variance, which is limited to 1.
        """
        square = float(self.squares[i])
        share = min(float(self._std(i, square)[0]) / square, 1.0) if square > 0.0 else 0.0
        return square * (1.0 + share**2 / 8.0) ** 2

    def interval(self, i: int, confidence: float) -> tuple[float, float]:
        """Return the interval of square i: the true values that could just give this estimate by chance.

        The standard deviation depends on the true value, and grows with it.
        """
        from scipy.special import ndtri  # noqa: PLC0415

        square, far = float(self.squares[i]), float(ndtri(0.5 * (1.0 + confidence)))
        largest = max(square, float(self._std(i, 0.0)[0]))
        # multiples of the square or of its deviation, whichever is larger
        truth = np.concatenate([[0.0], np.geomspace(1e-3, 1e2, 40) * largest])
        std = self._std(i, truth)
        low, high = (np.interp(square, np.maximum.accumulate(truth + sign * far * std), truth) for sign in (1, -1))
        return float(low), float(high)

    def _std(self, i: int, truth: float | Vector) -> Vector:
        """Return the standard deviations (p,) of square i for true values (p,), with the other squares as estimated."""
        squares = np.tile(self.squares, (np.size(truth), 1))
        squares[:, i] = truth
        A = self._A * self._scale
        C = np.einsum("pa,pb,abij->pij", squares, squares, self._products) + LEAST_SHARE * self._independent
        information = A.T @ np.linalg.solve(C, np.broadcast_to(A, (len(C), *A.shape)))
        return np.asarray(self._scale[i] * np.sqrt(np.linalg.pinv(information, hermitian=True)[:, i, i]))


def _products(sizes: Vector, samples: int) -> Vector:
    """Return (4, 4, k, k): Cov(AVAR_i, AVAR_j) is its sum over a and b, times the squares a and b."""
    f = np.geomspace(0.003 / sizes[-1], 0.5, 160 * math.ceil(math.log2(200.0 * sizes[-1])))
    sine2 = np.sin(np.pi * f) ** 2
    S = np.stack([np.ones(len(f)), 1.0 / (2.0 * np.pi * f), 1.0 / (4.0 * sine2), 4.0 * sine2])
    H = 2.0 * np.sin(np.pi * np.outer(sizes, f)) ** 4 / (sizes[:, None] ** 2 * sine2)
    weighted = (S[:, None] * H * np.sqrt(2.0 * np.gradient(f))).reshape(-1, len(f))
    of = np.maximum(samples - 2.0 * sizes + 1.0, 1.0)
    products = (weighted @ weighted.T).reshape(len(S), len(sizes), len(S), len(sizes)).swapaxes(1, 2)
    return np.asarray(2.0 * products / np.sqrt(np.outer(of, of)))
