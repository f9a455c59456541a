"""Estimator for a board that cannot be turned upside down: the hand's model with priors from the data sheet.

Near level, the scale factor and the bias of the vertical axis have the same effect. So each parameter has the data
sheet's tolerance as prior; those that the tilts do not observe keep it, and are named (`Fit.at_prior`).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import compress

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat
from .fit import Fit
from .hand import PASSES
from .hand_noise import FIRST_MPS2, WHITE_MPS2, most_likely_sigma
from .hypothesis_tests import KNOWN, undetermined
from .levenberg_marquardt import ROUGHLY, Minimum, minimise
from .parameters import B_A_NAMES, D_NAMES, NAMES
from .preprocessing import CORRELATION_S, Preprocessed, preprocess
from .problem import Problem
from .static import BIAS_SD_MPS2
from .theta import Theta

# Of each element of D: a breakout is mounted tilted by some degrees, which adds to the data sheet's +-2 % across axes.
D_SD = 0.025
# The largest tilt that is asked for, and a little more.
CONE_RAD = np.deg2rad(35.0)
# So many times the standard deviations of H hold the errors in arms that sway: an rms of 0.5 of them in a steady hand,
# and of 0.9 in a standing one.
HONEST = 4.0


def fit_tilt(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """Estimate D, b_a, b_omega and K of a sensor that stayed within a tilt of its flat orientation."""
    prepared = preprocess(recording, (flat.first, flat.last), gravity)
    prior = prepared.prior(D=(np.eye(3).ravel(), D_SD), b_a=(0.0, BIAS_SD_MPS2))
    u = prepared.flat.y / np.linalg.norm(prepared.flat.y)
    theta = Theta.start(np.eye(3), np.zeros(3), prepared.flat.b_omega, u)
    minimum = minimise(_white(prepared, 0.0), theta, len(NAMES), prior, frozen=True)
    for _ in range(PASSES):
        sigma = most_likely_sigma(prepared.white, WHITE_MPS2, minimum.theta, FIRST_MPS2)
        minimum = minimise(_white(prepared, sigma), minimum.theta, len(NAMES), prior, until=ROUGHLY)
    return _as_fit(minimum)


def tilted_directions(down: Vector, directions: Vector) -> Vector:
    """Return those of `directions` (n, 3) within the cone about the unit vector `down` (3,)."""
    return np.asarray(directions[directions @ down >= np.cos(CONE_RAD)])


def _white(prepared: Preprocessed, sigma: float) -> Problem:
    # A redescending loss does not converge from far away.
    return replace(prepared.white(sigma, CORRELATION_S), tail=0.0 if sigma == 0.0 else 1.0)


def _as_fit(minimum: Minimum) -> Fit:
    # Small angles separate a scale factor from a bias by second-order effects, for which no noise model is exact, and
    # less so where outliers are left in the innovations: their mean square is 3 in white noise.
    spread = HONEST * max(1.0, minimum.nis / 3.0) ** 0.5
    covariance = spread**2 * minimum.covariance()
    sd = np.sqrt(np.maximum(np.diag(covariance)[:12], 0.0))
    left = sd > KNOWN * np.repeat([D_SD, BIAS_SD_MPS2], [9, 3])
    return minimum.as_fit((*compress(D_NAMES + B_A_NAMES, left), *undetermined(covariance)), spread=spread)
