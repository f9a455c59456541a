"""Multi-position calibration: D and b_a by the magnitude of gravity at rest, without the gyroscope.

Source: Frosio, Pedersini, Borghese, IEEE TIM 58 (2009), equation 5. D is symmetric, nine parameters in all: without a
gyroscope the orientation of the accelerometer on its board is not observable.
"""

from __future__ import annotations

from itertools import compress

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat
from ..rests.intervals import RestFinder, statistics
from ..rests.tremor import SWAY_PER_S, mean_variance, without_tremor
from ..result.correlation import UPPER
from .fit import Fit
from .hypothesis_tests import KNOWN, MOST_STD
from .levenberg_marquardt import DECREMENT, MOST_ITERATIONS
from .parameters import B_A_NAMES, BY_NAME, D_NAMES, Form
from .poses import POSE_MPS2
from .theta import from_elements
from .transitions import REWEIGHTED

BIAS_SD_MPS2 = 0.5
# The accelerometer's data sheet has the tolerances of the gyroscope's: PS-MPU-6000A r3.4, sections 6.1 and 6.2.
PRIOR_SD = np.append(BY_NAME["K"].sd, [BIAS_SD_MPS2] * 3)
# (12, 9) maps the upper triangle of D and b_a to D row-major and b_a.
ALL_OF_NINE = np.eye(9)[np.append(from_elements(Form.SYMMETRIC, np.arange(6.0)), [6, 7, 8]).astype(int)]
# Errors [m/s^2] that rests may have beside noise and tremor: the least that explains the residuals is taken.
SPREADS_MPS2 = np.append(0.0, np.geomspace(1e-4, 1.0, 80))


def fit_static(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """Estimate D (symmetric) and b_a from the rests of a recording; the gyroscope only helps to detect them.

    K is the identity, b_omega the flat segment's mean. Elements that the rests hardly determine keep the data sheet's
    tolerance (`Fit.at_prior`).
    """
    y, variance = _rests(recording, flat)
    start = x = np.append(np.eye(3)[UPPER], np.zeros(3))
    extra, iterations, settled = SPREADS_MPS2[0], 0, False
    while True:
        e, J, along = _residuals(x, y, gravity, variance)
        weight = 1.0 / (along + extra**2)
        weighted = J * weight[:, None]
        information = weighted.T @ J
        covariance = np.linalg.inv(information + np.diag(PRIOR_SD**-2.0))
        left = len(y) - float(np.sum(covariance * information))  # degrees of freedom
        if settled or iterations == MOST_ITERATIONS:
            break
        gradient = weighted.T @ e + (start - x) / PRIOR_SD**2
        step = covariance @ gradient
        x, iterations = x + step, iterations + 1
        if iterations <= REWEIGHTED:  # later, the spread would alternate between two steps of its scale
            extra = _spread(e - J @ step, along, left)
        settled = iterations > REWEIGHTED and bool(gradient @ step < DECREMENT**2)
    # The residuals of few rests hardly show the error of the model.
    doubt = min(left / (left - 2.0), MOST_STD**2) if left > 2.0 else MOST_STD**2
    covariance = np.linalg.inv(information / doubt + np.diag(PRIOR_SD**-2.0))
    unknown = np.sqrt(np.diag(covariance)) > KNOWN * PRIOR_SD
    return Fit(
        D=from_elements(Form.SYMMETRIC, x[:6]),
        b_a=x[6:],
        b_omega=flat.b_omega,
        K=np.eye(3),
        names=D_NAMES + B_A_NAMES,
        covariance=ALL_OF_NINE @ covariance @ ALL_OF_NINE.T,
        iterations=iterations,
        converged=settled,
        nis=3.0 * float(weight @ (e * e)) / max(left, 1.0),
        V=0.5 * float(weight @ (e * e)),
        spread_mps2=float(extra),
        freedom=left,
        at_prior=tuple(compress(D_NAMES + B_A_NAMES, ALL_OF_NINE @ unknown > 0.0)),
    )


def _rests(recording: Recording, flat: Flat) -> tuple[Vector, Vector]:
    """Return the mean accelerations (k, 3) of the rests, and the variance (k,) of each."""
    runs = RestFinder(recording, flat).typical()
    hand = without_tremor(recording, flat, runs, np.ones(len(runs)))
    seconds = (runs[:, 1] - runs[:, 0]) / recording.rate_hz
    noise = flat.Sigma_a.mean() / (runs[:, 1] - runs[:, 0])
    of_hand = hand.jitter + hand.sway * mean_variance(SWAY_PER_S * seconds)
    return statistics(hand.acc, runs)[0], POSE_MPS2**2 + noise + of_hand


def _residuals(x: Vector, y: Vector, gravity: float, variance: Vector) -> tuple[Vector, Vector, Vector]:
    """Return g - |s| (k,) of s = inv(D) (y - b_a), its derivatives (k, 9), and its variance (k,)."""
    inverse = np.linalg.inv(from_elements(Form.SYMMETRIC, x[:6]))
    s = (y - x[6:]) @ inverse
    length = np.linalg.norm(s, axis=1)
    v = (s / length[:, None]) @ inverse
    by_D = v[:, :, None] * s[:, None, :]
    J = -np.hstack([by_D.reshape(-1, 9), v]) @ ALL_OF_NINE
    return gravity - length, J, variance * np.sum(v * v, axis=1)


def _spread(e: Vector, variance: Vector, left: float) -> float:
    """Return the least spread that explains residuals (k,) with `left` degrees of freedom, or one if less is left."""
    chi2 = np.sum(e**2 / (variance + SPREADS_MPS2[:, None] ** 2), axis=1)
    enough = np.flatnonzero(chi2 <= max(left, 1.0))
    return float(SPREADS_MPS2[enough[0] if len(enough) else -1])
