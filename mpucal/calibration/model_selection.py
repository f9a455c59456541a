"""The models `accel` and `imu`, of a sensor that turns in place, and the choice among all models.

The simplest model is chosen that explains the data: by the mean squared innovation, and for K by a Wald test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

from ..data import Recording
from .downsampling import downsampled
from .fit import Fit
from .flat_segment import Flat, flat_statistics
from .gyro_matrix import WALD_99, at_prior, wald
from .hand import fit_hand
from .initial_estimate import initialise
from .levenberg_marquardt import Minimum, minimise
from .masks import mask
from .paper import fit_paper
from .parameters import ACCEL, IMU
from .prior import prior_of
from .problem import Problem, Series
from .tilt import fit_tilt

# The mean ||e||^2 of white noise is 3; a hand, or a gyroscope's scale, makes it tens to thousands.
EXPLAINED_NIS = 4.0
HOPELESS_NIS = 10.0  # of means over blocks, in which white noise is less and a hand's is not

SEARCH_HZ, ROUGHLY = 50.0, 0.05


class Choice(NamedTuple):
    """A fit, the model that made it, and why it was chosen."""

    fit: Fit
    model: str
    why: str


def fit_accel(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """D, b_a, b_omega and the first tilts, with the gyroscope's scale trusted: the paper's model, made efficient."""
    return _as_fit(_minimum(recording, flat, gravity, ACCEL, _rough(recording, flat, gravity, ACCEL)))


def fit_imu(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """As `accel`, with the gyroscope's matrix K."""
    return _as_fit(_minimum(recording, flat, gravity, IMU, _rough(recording, flat, gravity, IMU)))


METHODS: Mapping[str, Callable[[Recording, Flat, float], Fit]] = {
    "hand": fit_hand,
    "imu": fit_imu,
    "accel": fit_accel,
    "paper": fit_paper,
    "tilt": fit_tilt,
}


def choose(recording: Recording, flat: Flat, gravity: float) -> Choice:
    """The simplest model that explains the data.

    White noise and a trusted gyroscope first, then its matrix K, kept where a Wald test tells it from the identity.
    Data that neither explains were measured in a hand.
    """
    rough = _rough(recording, flat, gravity, ACCEL)
    nis = rough.nis
    if nis < HOPELESS_NIS:
        accel = _minimum(recording, flat, gravity, ACCEL, rough)
        nis = accel.nis
    if nis < EXPLAINED_NIS:
        imu = _minimum(recording, flat, gravity, IMU, accel)
        if imu.converged and wald(imu) > WALD_99:
            why = f"white noise explains the data (innovations {nis:.1f}, expected 3), and the gyroscope is not perfect"
            return Choice(_as_fit(imu), "imu", why)
        why = f"white noise and a perfect gyroscope explain the data (innovations {nis:.1f}, expected 3)"
        return Choice(_as_fit(accel), "accel", why)
    hand = fit_hand(recording, flat, gravity)
    kept = "K" if "K_xx" in hand.names else "no K (it is not told from the identity)"
    why = f"white noise does not explain the data (innovations {nis:.0f}, expected 3): a hand's model, with {kept}"
    return Choice(hand, "hand", why)


def _rough(recording: Recording, flat: Flat, gravity: float, parameters: int) -> Minimum:
    """On means over blocks: white noise leaves little in a block beside its mean."""
    thin, at = downsampled(recording, flat, SEARCH_HZ)
    problem = _problem(thin, flat_statistics(thin, at), gravity)
    theta = initialise(problem, flat.b_omega)
    return minimise(problem, theta, parameters, prior_of(flat), until=ROUGHLY)


def _minimum(recording: Recording, flat: Flat, gravity: float, parameters: int, near: Minimum) -> Minimum:
    """On all samples, from where another search ended."""
    minimum = minimise(_problem(recording, flat, gravity), near.theta, parameters, prior_of(flat))
    return replace(minimum, iterations=near.iterations + minimum.iterations)


def _problem(recording: Recording, flat: Flat, gravity: float) -> Problem:
    return Problem(mask(Series.after(recording, flat), recording, flat), flat, gravity)


def _as_fit(minimum: Minimum) -> Fit:
    return minimum.as_fit(at_prior(minimum.covariance()) if len(minimum.H) > ACCEL else ())
