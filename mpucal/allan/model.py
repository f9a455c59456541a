"""The noise behind an Allan variance: white noise, bias instability, random walk and quantisation, with intervals.

    AVAR(tau) = N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3 + 3 Q^2 / tau^2

(IEEE Std 952, annex C: N, B, K, Q), N in units/sqrt(Hz) of a two-sided density: a data sheet's, one-sided, is
sqrt(2) N.
The four squares are linear in it, and not negative: least squares, weighted by the covariance of the variances at all
octaves, which follows from the noise itself:

    Cov(AVAR_i, AVAR_j) = 2/n integral of S(f)^2 |H_i(f)|^2 |H_j(f)|^2 df
    |H_m|^2 = 2 sin^4(pi m f) / (m^2 sin^2(pi f))

as of wavelet variances (Percival, Biometrika 1995; Guerrier et al., JASA 2013). Time is in samples until the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Vector

NAMES = ("white_noise", "bias_instability", "random_walk", "quantisation")
CONFIDENCE = 0.95
# an octave with fewer differences that do not overlap says next to nothing
LEAST_CLUSTERS = 5.0
# the low-pass filter of a sensor hides white noise from the shortest times: so many octaves may be left out
MOST_LEFT_OUT = 7
FITS = 1e-3
ROUNDS, LEAST_SHARE = 6, 1e-4
# of a square that is not told from zero
LEAST_FREEDOM = 8.0


@dataclass(frozen=True)
class Coefficients:
    """Of one axis: (4,) in the order of NAMES, with the ends of their 95 % intervals; from which tau [samples] on."""

    value: Vector
    low: Vector
    high: Vector
    first: float


def fitted(sizes: Vector, variances: Vector, samples: int, step_s: float) -> Coefficients | None:
    """The coefficients of (k,) Allan variances at (k,) sizes in samples; None where there are too few octaves.

    step_s : time of a sample [s]; the coefficients are in units a root of a Hz, units, units a root of a s, units s.
    """
    used = (sizes <= samples / LEAST_CLUSTERS) & (variances > 0.0)
    sizes, variances = sizes[used], variances[used]
    best: tuple[float, int, Vector, Vector] | None = None
    for first in range(min(MOST_LEFT_OUT, max(len(sizes) - 5, 0)) + 1):
        if len(sizes) - first < 4:
            break
        squares, covariance, probability = _squares(sizes[first:], variances[first:], samples, first == 0)
        if best is None or probability > best[0]:
            best = probability, first, squares, covariance
        if probability > FITS:
            break
    if best is None:
        return None
    _, first, squares, covariance = best
    units = np.array([step_s, 1.0, 1.0 / step_s, step_s**2])
    low, high = _interval(squares, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    if first:
        squares, low, high = (np.append(part[:3], np.nan) for part in (squares, low, high))
    value, low, high = (np.sqrt(part * units) for part in (squares, low, high))
    return Coefficients(value, low, high, float(sizes[first]))


def modelled(sizes: Vector) -> Vector:
    """(k, 4) of the Allan variance at sizes (k,) by the squares of the coefficients, in samples."""
    m = np.asarray(sizes, float)
    flicker = np.full(len(m), 2.0 * math.log(2.0) / math.pi)
    return np.stack([1.0 / m, flicker, m / 3.0 + 1.0 / (6.0 * m), 3.0 / m**2], axis=1)


def _squares(sizes: Vector, variances: Vector, samples: int, quantised: bool) -> tuple[Vector, Vector, float]:
    """(4,), (4, 4), and how often the model shows variances as unlikely as these."""
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import
    from scipy.stats import chi2  # noqa: PLC0415

    kept = [0, 1, 2, 3] if quantised else [0, 1, 2]
    A = modelled(sizes)[:, kept]
    scale = variances[0] / np.abs(A).max(0)
    # as if every octave stood alone: where to begin, and a floor for noise of another kind than these
    alone = np.diag(2.0 * variances**2 * sizes / samples)
    C = alone
    for _ in range(ROUNDS):
        root = np.linalg.cholesky(C + LEAST_SHARE * alone)
        W, w = np.linalg.solve(root, A * scale), np.linalg.solve(root, variances)
        squares = scale * nnls(W, w)[0]
        C = _covariance(sizes, squares if quantised else np.append(squares, 0.0), samples)
    left = w - W @ (squares / scale)
    probability = float(chi2.sf(left @ left, max(len(sizes) - len(kept), 1)))
    covariance = np.zeros((4, 4))
    covariance[np.ix_(kept, kept)] = np.linalg.pinv(W.T @ W) * np.outer(scale, scale)
    full = np.zeros(4)
    full[kept] = squares
    return full, covariance, probability


def _covariance(sizes: Vector, squares: Vector, samples: int) -> Vector:
    """(k, k) of the Allan variances, by the density of the noise."""
    f = np.geomspace(0.003 / sizes[-1], 0.5, 160 * math.ceil(math.log2(200.0 * sizes[-1])))
    sine2 = np.sin(np.pi * f) ** 2
    white, flicker, walk, quantised = squares
    S = white + flicker / (2.0 * np.pi * f) + walk / (4.0 * sine2) + quantised * 4.0 * sine2
    H = 2.0 * np.sin(np.pi * np.outer(sizes, f)) ** 4 / (sizes[:, None] ** 2 * sine2)
    weighted = S * H * np.sqrt(2.0 * np.gradient(f))
    of = np.maximum(samples - 2.0 * sizes + 1.0, 1.0)
    return np.asarray(2.0 * weighted @ weighted.T / np.sqrt(np.outer(of, of)))


def _interval(squares: Vector, std: Vector) -> tuple[Vector, Vector]:
    """The ends of 95 % intervals of squares, which are not negative.

    Their errors are those of the other coefficients as well: as of a normal variable below. Above, the std that was
    found is too small where the square is: as of a chi-squared variable, or a normal one, whichever is farther.
    """
    from scipy.stats import chi2, norm  # noqa: PLC0415

    tail = 0.5 * (1.0 - CONFIDENCE)
    std = np.maximum(std, 1e-12 * np.maximum(squares, 1e-300))
    freedom = np.maximum(2.0 * (squares / std) ** 2, LEAST_FREEDOM)
    aside = norm.isf(tail) * std
    return np.maximum(squares - aside, 0.0), np.maximum(
        squares + aside, squares * freedom / chi2.isf(1.0 - tail, freedom)
    )
