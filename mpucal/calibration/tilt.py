"""The estimator for a sensor that was tilted and never turned over: the hand's model with what is known beforehand.

Near level, gains and biases of the vertical look alike. So every parameter begins with its data sheet's tolerance, and
those that the tilts leave there are named: they are not estimates, and nobody should claim them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Recording, Vector
from .fit import Fit
from .flat_segment import Flat
from .gyro_matrix import KNOWN, at_prior
from .hand import ROUGHLY
from .hand_noise import WHITE_MPS2
from .levenberg_marquardt import Minimum, minimise
from .likelihood import value
from .parameters import B_A_NAMES, D_NAMES, NAMES
from .preprocessing import CORRELATION_S, Preprocessed, preprocess
from .prior import Prior, prior_of
from .problem import Problem
from .theta import Theta

# PS-MPU-6000A r3.4, section 6.2: +-3 % of gain, +-2 % across axes; a breakout sits askew by some degrees.
GAIN_SD, LEAN_SD, BIAS_SD_MPS2 = 0.02, 0.025, 0.5
# as far as tilts may be asked for, and a little more
CONE_RAD = np.deg2rad(35.0)
ROUNDS = 2
# Small angles tell a gain from a bias by second-order effects, which no noise model knows to the last bit.
HONEST = 2.5


def fit_tilt(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """D, b_a, b_omega, K of a sensor that stayed within a tilt of how it lay flat."""
    prepared = preprocess(recording, (flat.first, flat.last), gravity)
    prior = _prior(prepared.flat)
    u = prepared.flat.y / np.linalg.norm(prepared.flat.y)
    theta = Theta.start(np.eye(3), np.zeros(3), prepared.flat.b_omega, u)
    minimum = minimise(_white(prepared, 0.0), theta, len(NAMES), prior, frozen=True)
    for _ in range(ROUNDS):
        sigma = min(WHITE_MPS2, key=lambda s: value(prepared.white(s), minimum.theta))
        minimum = minimise(_white(prepared, sigma), minimum.theta, len(NAMES), prior, until=ROUGHLY, frozen=True)
    return _as_fit(minimum)


def tilted_directions(down: Vector, directions: Vector) -> Vector:
    """Those of `directions` (n, 3) within the cone about the unit vector `down` (3,)."""
    return np.asarray(directions[directions @ down >= np.cos(CONE_RAD)])


def _white(prepared: Preprocessed, sigma: float) -> Problem:
    # a redescending loss forgets a start that is far away
    return replace(prepared.white(sigma, CORRELATION_S), tail=0.0 if sigma == 0.0 else 1.0)


def _prior(flat: Flat) -> Prior:
    sd = np.where(np.eye(3) > 0, GAIN_SD, LEAN_SD).ravel()
    return prior_of(flat, D=(np.eye(3).ravel(), sd), b_a=(0.0, BIAS_SD_MPS2))


def _as_fit(minimum: Minimum) -> Fit:
    covariance = HONEST**2 * minimum.covariance()
    before = np.concatenate([np.where(np.eye(3) > 0, GAIN_SD, LEAN_SD).ravel(), np.full(3, BIAS_SD_MPS2)])
    sd = np.sqrt(np.maximum(np.diag(covariance)[:12], 0.0))
    left = tuple(name for name, open_ in zip(D_NAMES + B_A_NAMES, sd > KNOWN * before, strict=True) if open_)
    return minimum.as_fit((*left, *at_prior(covariance)), spread=HONEST)
