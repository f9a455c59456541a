"""The models `accel` and `imu`, of a sensor that turns in place, and the choice among all models.

The simplest model is chosen that explains the data: by the mean squared innovation, for K by a Wald test, and for a
lever arm by a score test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat, flat_statistics
from .bias_walks import find_walk, remove_walk
from .downsampling import downsampled
from .fit import Fit
from .hand import fit_hand
from .hypothesis_tests import WALD_99, find_lever_arm, undetermined, wald
from .initial_estimate import initialise
from .levenberg_marquardt import MOST_ITERATIONS, Minimum, minimise
from .likelihood import evaluate
from .masks import mask
from .paper import fit_paper
from .parameters import ACCEL, IMU
from .parts import ends_of, parts_of
from .problem import Problem, Series
from .rotation import lengths
from .static import fit_static
from .theta import Prior, Theta
from .tilt import fit_tilt

# The mean ||e||^2 of white noise is 3; a hand, or a gyroscope's scale, makes it tens to thousands.
EXPLAINED_NIS = 4.0
EXPLAINED_BY_ERRORS_NIS = 3.3  # whose sizes are the likeliest, and leave 3 where they are what the sensors err by
HOPELESS_NIS = 10.0  # of means over blocks, in which white noise is less and a hand's is not

SEARCH_HZ, ROUGHLY = 50.0, 0.05
COARSE_HZ, MANY_MEANS = 10.0, 20_000  # of more means than so many, 10 a second show first whether a search has an end


class Errors(NamedTuple):
    """What a sensor errs by beyond the noise that it has at rest.

    kappa : rad a root of rad, by which a turn is off for each rad turned (nonlinearity, steps too long for a turn).
    floor : m/s^2 of white noise beside the accelerometer's own.
    """

    kappa: float = 0.0
    floor: float = 0.0


NO_ERRORS = Errors()
ERRORS = tuple(Errors(kappa, floor) for kappa in (0.0, 1e-4, 3e-4, 1e-3) for floor in (0.0, 1e-3, 3e-3, 1e-2))
ERROR_PASSES, ERRING_NIS = 2, 30.0
MOST_WALKS = 2
PROMISING = WALD_99 / 3.0  # of the decrement, of which twice is as much of the statistic


class ModelChoice(NamedTuple):
    """A fit, the model that made it, and why it was chosen.

    recording : what it was fitted to, without a walk of its gyroscope's bias of `walked` [(rad/s)^2] from part to part.
    """

    fit: Fit
    model: str
    why: str
    recording: Recording
    walked: float = 0.0


def fit_accel(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """D, b_a, b_omega and the first tilts, with the gyroscope's scale trusted: the paper's model, made efficient."""
    return _InPlace(recording, flat, gravity).fit(ACCEL)


def fit_imu(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """As `accel`, with the gyroscope's matrix K."""
    return _InPlace(recording, flat, gravity).fit(IMU)


METHODS: Mapping[str, Callable[[Recording, Flat, float], Fit]] = {
    "hand": fit_hand,
    "imu": fit_imu,
    "accel": fit_accel,
    "paper": fit_paper,
    "tilt": fit_tilt,
    "static": fit_static,
}


def choose(recording: Recording, flat: Flat, gravity: float) -> ModelChoice:
    """The simplest model that explains the data.

    White noise and a trusted gyroscope first, then its matrix K; the same with a steadied gyroscope, and with small
    errors of both sensors. K is kept where a Wald test tells it from the identity. Data that none of them explains, or
    that show a lever arm, were measured in a hand.
    """
    least = np.inf
    for in_place, erring in _InPlace(recording, flat, gravity).attempts():
        for parameters in (ACCEL, IMU):
            minimum, errors = in_place.explained(parameters, erring)
            least = min(least, minimum.nis)
            if minimum.nis >= (EXPLAINED_BY_ERRORS_NIS if erring else EXPLAINED_NIS):
                continue
            if parameters == ACCEL:
                imu = in_place.with_matrix(minimum, errors)
                minimum = minimum if imu is None else imu
            r = in_place.lever_arm(minimum, errors)
            if r is None:
                return _chosen(in_place, minimum, errors)
            why = f"the data show a lever arm of {1e3 * np.linalg.norm(r):.0f} mm"
            return _in_a_hand(recording, flat, gravity, why)
    return _in_a_hand(
        recording, flat, gravity, f"white noise does not explain the data (innovations {least:.0f}, expected 3)"
    )


def _in_a_hand(recording: Recording, flat: Flat, gravity: float, why: str) -> ModelChoice:
    hand = fit_hand(recording, flat, gravity)
    kept = "K" if "K_xx" in hand.names else "no K (it is not told from the identity)"
    return ModelChoice(hand, "hand", f"{why}: a hand's model, with {kept}", recording)


def _chosen(in_place: _InPlace, minimum: Minimum, errors: Errors) -> ModelChoice:
    perfect = len(minimum.free) == ACCEL
    noise = "white noise" if errors == NO_ERRORS else "white noise with small errors of the sensors"
    gyroscope = "a perfect gyroscope explain" if perfect else "a gyroscope that is not perfect explain"
    why = f"{noise} and {gyroscope} the data (innovations {minimum.nis:.1f}, expected 3)"
    model = "accel" if perfect else "imu"
    return ModelChoice(in_place.as_fit(minimum, errors), model, why, in_place.recording, in_place.walked)


class _InPlace:
    """The exact filter's fits of a recording of a sensor that turns in place."""

    def __init__(self, recording: Recording, flat: Flat, gravity: float, walked: float = 0.0) -> None:
        self.recording, self._flat, self._gravity, self.walked = recording, flat, gravity, walked
        self._prior = Prior.of_sensor(flat, recording.sensor)
        self._roughly: dict[int, Minimum] = {}

    def attempts(self) -> Iterator[tuple[_InPlace, bool]]:
        """Recordings to explain, and whether with errors of the sensors: the simplest first."""
        yield self, False
        if self._errs():
            yield self._steadied(), False
            yield self, True

    def _errs(self) -> bool:
        """Whether errors of the largest size could explain the data."""
        squares = evaluate(_erring(self._thin, ERRORS[-1]), self._rough(IMU).theta, 0).squares
        return squares < ERRING_NIS * (self._thin.flat.last + len(self._thin.series))

    def _steadied(self) -> _InPlace:
        """Without the walk of the gyroscope's bias that the parts show; small errors would explain that as well."""
        steady = self
        for _ in range(MOST_WALKS):
            rough = steady._rough(IMU)
            parts = parts_of(steady._thin, rough, self._prior)
            walk = None if parts is None else find_walk(parts, rough.theta.D)
            if walk is None or walk.what != "gyroscope":
                break
            recording, walked = remove_walk(steady.recording, self._flat, walk), steady.walked + walk.q
            steady = _InPlace(recording, self._flat, self._gravity, walked)
        return steady

    def fit(self, parameters: int) -> Fit:
        """With white noise alone, whether it explains the data or not."""
        return self.as_fit(self.minimum(parameters, self._rough(parameters)), NO_ERRORS)

    def explained(self, parameters: int, erring: bool) -> tuple[Minimum, Errors]:
        """The minimum, rough where it is hopeless, and the errors that make it likeliest."""
        errors = NO_ERRORS
        minimum = self._rough(parameters)
        for _ in range(ERROR_PASSES if erring else 0):
            theta = minimum.theta
            errors = min(ERRORS, key=lambda these: evaluate(_erring(self._thin, these), theta, 0).V)
            minimum = minimise(_erring(self._thin, errors), theta, parameters, self._prior, until=ROUGHLY)
        if minimum.nis < HOPELESS_NIS:
            minimum = self.minimum(parameters, minimum, errors)
        return minimum, errors

    def minimum(self, parameters: int, near: Minimum, errors: Errors = NO_ERRORS) -> Minimum:
        """On all samples, from where another search ended; a search without an end has none on all samples either."""
        problem, most = _erring(self._problem, errors), MOST_ITERATIONS if near.converged else 0
        minimum = minimise(problem, near.theta, parameters, self._prior, most=most, ends=ends_of(problem))
        return replace(minimum, iterations=near.iterations + minimum.iterations)

    def with_matrix(self, near: Minimum, errors: Errors) -> Minimum | None:
        """With K beside the parameters of `accel`; None where it is not told from the identity.

        The statistic is twice what V falls by: where the first decrement promises little of it, the search ends there.
        """
        problem = _erring(self._problem, errors)
        if not near.converged:
            return None
        if minimise(problem, near.theta, IMU, self._prior, until=PROMISING, most=1).iterations == 0:
            return None
        imu = self.minimum(IMU, near, errors)
        return imu if imu.converged and wald(imu) > WALD_99 else None

    def lever_arm(self, minimum: Minimum, errors: Errors) -> Vector | None:
        """The lever arm r (3,) [m] of a sensor that does not turn in place."""
        return find_lever_arm(_erring(self._thin, errors), *self._means(SEARCH_HZ), minimum, self._prior)

    def as_fit(self, minimum: Minimum, errors: Errors) -> Fit:
        """With what the parts of the recording say."""
        known = undetermined(minimum.covariance()) if len(minimum.free) > ACCEL else ()
        return minimum.as_fit(known, parts_of(_erring(self._problem, errors), minimum, self._prior))

    def _rough(self, parameters: int) -> Minimum:
        if parameters not in self._roughly:
            self._roughly[parameters] = self._searched(parameters)
        return self._roughly[parameters]

    def _searched(self, parameters: int) -> Minimum:
        """A long recording is searched by coarser means first, as far as they explain it."""
        theta, most, iterations = self._first, MOST_ITERATIONS, 0
        if len(self._thin.series) > MANY_MEANS:
            coarse = minimise(
                _problem(*self._means(COARSE_HZ), self._gravity), theta, parameters, self._prior, until=ROUGHLY
            )
            if coarse.nis < EXPLAINED_NIS:
                theta, iterations = coarse.theta, coarse.iterations
                most = MOST_ITERATIONS if coarse.converged else 0
        minimum = minimise(self._thin, theta, parameters, self._prior, until=ROUGHLY, most=most)
        return replace(minimum, iterations=iterations + minimum.iterations)

    @cached_property
    def _first(self) -> Theta:
        return initialise(self._thin, self._flat.b_omega)

    @cached_property
    def _problem(self) -> Problem:
        return _problem(self.recording, self._flat, self._gravity)

    @cached_property
    def _thin(self) -> Problem:
        """Means over blocks: white noise leaves little in a block beside its mean."""
        return _problem(*self._means(SEARCH_HZ), self._gravity)

    def _means(self, rate_hz: float) -> tuple[Recording, Flat]:
        thin, at = downsampled(self.recording, self._flat, rate_hz)
        return thin, flat_statistics(thin, at)


def _problem(recording: Recording, flat: Flat, gravity: float) -> Problem:
    return Problem(mask(Series.after(recording, flat), recording, flat), flat, gravity)


def _erring(problem: Problem, errors: Errors) -> Problem:
    """With errors of the sensors."""
    series, flat = problem.series, problem.flat
    if errors.kappa > 0.0:
        turned = series.dt * lengths(series.omega - flat.b_omega)
        q_extra = 0.0 if series.q_extra is None else series.q_extra
        series = replace(series, q_extra=q_extra + errors.kappa**2 * turned)
    return replace(problem, series=series, flat=replace(flat, Sigma_a=flat.Sigma_a + errors.floor**2))
