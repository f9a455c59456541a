"""The estimators without a hand, and the choice among all of them. Knows no verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from ..data import Recording
from .gyro import K_MEAN, K_SD, WALD_99, at_prior, wald
from .hand import fit_hand
from .initialise import initialise
from .likelihood import NAMES, Problem, Series
from .masks import mask
from .minimise import Minimum, Prior, minimise
from .model import Fit, Flat
from .paper import fit_paper

# The mean ||e||^2 of white noise is 3; a hand, or a gyroscope's scale, makes it tens to thousands.
EXPLAINED_NIS = 4.0

ACCEL, IMU = 17, 23


class Choice(NamedTuple):
    """A fit, the model that made it, and why it was chosen."""

    fit: Fit
    model: str
    why: str


def fit_accel(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """D, b_a, b_omega and the first tilts, with the gyroscope's scale trusted: the paper's model, made efficient."""
    return _as_fit(_minimum(recording, flat, gravity, ACCEL), recording, flat)


def fit_imu(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """As `accel`, with the gyroscope's matrix K."""
    return _as_fit(_minimum(recording, flat, gravity, IMU), recording, flat)


METHODS: Mapping[str, Callable[[Recording, Flat, float], Fit]] = {
    "hand": fit_hand,
    "imu": fit_imu,
    "accel": fit_accel,
    "paper": fit_paper,
}


def choose(recording: Recording, flat: Flat, gravity: float) -> Choice:
    """The simplest model that explains the data.

    White noise and a trusted gyroscope first, then its matrix K, kept where a Wald test tells it from the identity.
    Data that neither explains were measured in a hand.
    """
    accel = _minimum(recording, flat, gravity, ACCEL)
    nis = accel.squares / (len(recording) - flat.last)
    if nis < EXPLAINED_NIS:
        imu = _minimum(recording, flat, gravity, IMU)
        if imu.converged and wald(imu) > WALD_99:
            why = f"white noise explains the data (innovations {nis:.1f}, expected 3), and the gyroscope is not perfect"
            return Choice(_as_fit(imu, recording, flat), "imu", why)
        why = f"white noise and a perfect gyroscope explain the data (innovations {nis:.1f}, expected 3)"
        return Choice(_as_fit(accel, recording, flat), "accel", why)
    hand = fit_hand(recording, flat, gravity)
    kept = "K" if "K_xx" in hand.names else "no K (it is not told from the identity)"
    why = f"white noise does not explain the data (innovations {nis:.0f}, expected 3): a hand's model, with {kept}"
    return Choice(hand, "hand", why)


def _minimum(recording: Recording, flat: Flat, gravity: float, parameters: int) -> Minimum:
    problem = Problem(mask(Series.after(recording, flat), recording, flat), flat, gravity)
    known = {"b_omega": (flat.b_omega, np.sqrt(flat.Sigma_omega / flat.n)), "K": (K_MEAN, K_SD)}
    return minimise(problem, initialise(problem, flat.b_omega), parameters, Prior.of(**known))


def _as_fit(minimum: Minimum, recording: Recording, flat: Flat) -> Fit:
    theta, parameters = minimum.theta, len(minimum.H)
    covariance = minimum.covariance()
    names = NAMES[:parameters]
    return Fit(
        D=theta.D,
        b_a=theta.b_a,
        b_omega=theta.b_omega,
        K=theta.K,
        names=names,
        covariance=covariance,
        iterations=minimum.iterations,
        converged=minimum.converged,
        nis=minimum.squares / max(len(recording) - flat.last, 1),
        V=minimum.V,
        at_prior=at_prior(covariance) if parameters > ACCEL else (),
    )
