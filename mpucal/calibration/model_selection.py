"""Selection of the model, and the models `accel` and `imu` of a sensor that turns in place.

The simplest model that explains the data is selected: by the mean squared innovation, for K by a Wald test, and for a
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
from .downsampling import SEARCH_HZ, downsampled
from .fit import Fit
from .hand import fit_hand
from .hypotheses import explain, gyroscope_change, remove_change
from .hypothesis_tests import WALD_99, find_lever_arm, undetermined, wald
from .initial_estimate import initialise
from .levenberg_marquardt import MOST_ITERATIONS, ROUGHLY, Minimum, minimise
from .likelihood import evaluate
from .masks import mask
from .paper import fit_paper
from .parameters import ACCEL, ACCELEROMETER, IMU
from .parts import ends_of, parts_of
from .problem import Problem, Series
from .rotation import lengths
from .static import fit_static
from .theta import Prior, Theta
from .tilt import fit_tilt

# The mean ||e||^2 of white noise is 3, and by chance so many standard deviations more at most; a hand, or a
# gyroscope's scale, makes it tens to thousands.
WHITE_NIS, MOST_STD = 3.0, 5.0
HOPELESS_NIS = 10.0  # of means over blocks, which reduce white noise and not a hand's

# With more block means than so many, means at 10 Hz show first whether a search converges.
COARSE_HZ, MANY_MEANS = 10.0, 20_000


class Errors(NamedTuple):
    """Model errors beyond the noise at rest: angle random walk and white-noise floor.

    kappa : rad a root of rad, error of a turn (nonlinearity, steps too long for a turn).
    floor : m/s^2, white noise in addition to the accelerometer's own.
    """

    kappa: float = 0.0
    floor: float = 0.0


NO_ERRORS = Errors()
ERRORS = tuple(Errors(kappa, floor) for kappa in (0.0, 1e-4, 3e-4, 1e-3) for floor in (0.0, 1e-3, 3e-3, 1e-2))
ERROR_PASSES, ERRING_NIS = 2, 30.0
MOST_CHANGES = 2
UNCHANGED = np.zeros(len(range(ACCEL)[ACCELEROMETER]))
PROMISING = WALD_99 / 3.0  # least decrement for a search with K: twice the decrement estimates the statistic


class ModelChoice(NamedTuple):
    """Chosen model: its name, its fit, and why it was chosen.

    recording : as fitted, without changes of its gyroscope's bias. freed : (12,) see claim_uncertainty.
    """

    fit: Fit
    model: str
    why: str
    recording: Recording
    freed: Vector = UNCHANGED


def fit_accel(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """Estimate D, b_a, b_omega and the first tilts with a trusted gyroscope: the paper's model, made efficient."""
    return InPlaceFits(recording, flat, gravity).fit(ACCEL)


def fit_imu(recording: Recording, flat: Flat, gravity: float) -> Fit:
    """Estimate the parameters of `accel` and the gyroscope's matrix K."""
    return InPlaceFits(recording, flat, gravity).fit(IMU)


METHODS: Mapping[str, Callable[[Recording, Flat, float], Fit]] = {
    "hand": fit_hand,
    "imu": fit_imu,
    "accel": fit_accel,
    "paper": fit_paper,
    "tilt": fit_tilt,
    "static": fit_static,
}


def choose_model(recording: Recording, flat: Flat, gravity: float) -> ModelChoice:
    """Choose the simplest model that explains the data.

    White noise and a trusted gyroscope come first, then its matrix K; then the same without a change of the gyroscope's
    bias, and with small errors of both sensors. K is kept where a Wald test finds it different from the identity. Data
    that none of them explains, or that show a lever arm, were measured in a hand.
    """
    least = np.inf
    for in_place, erring in InPlaceFits(recording, flat, gravity).attempts():
        for parameters in (ACCEL, IMU):
            minimum, errors = in_place.explain(parameters, erring)
            least = min(least, minimum.nis)
            if minimum.nis >= in_place.most_nis:
                continue
            if parameters == ACCEL:
                imu = in_place.fit_matrix(minimum, errors)
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
    kept = "K" if "K_xx" in hand.names else "no K (it is not significantly different from the identity)"
    return ModelChoice(hand, "hand", f"{why}: a hand's model, with {kept}", recording)


def _chosen(in_place: InPlaceFits, minimum: Minimum, errors: Errors) -> ModelChoice:
    perfect = len(minimum.free) == ACCEL
    noise = "white noise" if errors == NO_ERRORS else "white noise with small errors of the sensors"
    gyroscope = "a perfect gyroscope explain" if perfect else "a gyroscope that is not perfect explain"
    why = f"{noise} and {gyroscope} the data (innovations {minimum.nis:.1f}, expected 3)"
    model = "accel" if perfect else "imu"
    return ModelChoice(in_place.as_fit(minimum, errors), model, why, in_place.recording, in_place.freed)


class InPlaceFits:
    """Fits of a sensor that turns in place, by the exact filter, to one recording."""

    def __init__(self, recording: Recording, flat: Flat, gravity: float, freed: Vector = UNCHANGED) -> None:
        self.recording, self._flat, self._gravity, self.freed = recording, flat, gravity, freed
        self._prior = Prior.of_sensor(flat, recording.sensor)
        self._roughly: dict[int, Minimum] = {}

    def attempts(self) -> Iterator[tuple[InPlaceFits, bool]]:
        """Yield the recordings to explain, and True with errors of the sensors: the simplest first."""
        yield self, False
        if self._errors_may_explain():
            yield self._without_change(), False
            yield self, True

    def _errors_may_explain(self) -> bool:
        """Return True if errors of the largest size could explain the data."""
        squares = evaluate(_with_errors(self._thin, ERRORS[-1]), self._rough(IMU).theta, 0).squares
        return squares < ERRING_NIS * (self._thin.flat.last + len(self._thin.series))

    def _without_change(self) -> InPlaceFits:
        """Remove the change of the gyroscope's bias that the parts show, which small errors would explain as well."""
        steady = self
        for _ in range(MOST_CHANGES):
            rough = steady._rough(IMU)
            parts = parts_of(steady._thin, rough, self._prior)
            change = gyroscope_change(explain(parts, rough.theta.D)) if parts else None
            if change is None:
                break
            recording, freed = remove_change(steady.recording, self._flat, change), change.freed[ACCELEROMETER]
            steady = InPlaceFits(recording, self._flat, self._gravity, steady.freed + freed)
        return steady

    def fit(self, parameters: int) -> Fit:
        """Fit with white noise alone, whether or not it explains the data."""
        return self.as_fit(self.minimum(parameters, self._rough(parameters)), NO_ERRORS)

    def explain(self, parameters: int, erring: bool) -> tuple[Minimum, Errors]:
        """Return the minimum, a rough one where it explains nothing, and the most likely errors."""
        errors = NO_ERRORS
        minimum = self._rough(parameters)
        for _ in range(ERROR_PASSES if erring else 0):
            theta = minimum.theta
            errors = min(ERRORS, key=lambda these: evaluate(_with_errors(self._thin, these), theta, 0).V)
            minimum = minimise(_with_errors(self._thin, errors), theta, parameters, self._prior, until=ROUGHLY)
        if minimum.nis < HOPELESS_NIS:
            minimum = self.minimum(parameters, minimum, errors)
        return minimum, errors

    def minimum(self, parameters: int, near: Minimum, errors: Errors = NO_ERRORS) -> Minimum:
        """Search on all samples from the end of a rough search; if that did not converge, evaluate without a step."""
        problem, most = _with_errors(self._problem, errors), MOST_ITERATIONS if near.converged else 0
        minimum = minimise(problem, near.theta, parameters, self._prior, most=most, ends=ends_of(problem))
        return replace(minimum, iterations=near.iterations + minimum.iterations)

    def fit_matrix(self, near: Minimum, errors: Errors) -> Minimum | None:
        """Fit K as well; None where a Wald test does not find it different from the identity.

        The statistic is twice the fall of V: where the first decrement promises little, the search ends there.
        """
        problem = _with_errors(self._problem, errors)
        if not near.converged:
            return None
        if minimise(problem, near.theta, IMU, self._prior, until=PROMISING, most=1).iterations == 0:
            return None
        imu = self.minimum(IMU, near, errors)
        return imu if imu.converged and wald(imu) > WALD_99 else None

    def lever_arm(self, minimum: Minimum, errors: Errors) -> Vector | None:
        """Return the lever arm r (3,) [m] of a sensor that does not turn in place, else None."""
        return find_lever_arm(_with_errors(self._thin, errors), *self._means(SEARCH_HZ), minimum, self._prior)

    def as_fit(self, minimum: Minimum, errors: Errors) -> Fit:
        """Return the fit with the scores of the recording's parts."""
        known = undetermined(minimum.covariance()) if len(minimum.free) > ACCEL else ()
        return minimum.as_fit(known, parts_of(_with_errors(self._problem, errors), minimum, self._prior))

    def _rough(self, parameters: int) -> Minimum:
        if parameters not in self._roughly:
            self._roughly[parameters] = self._search(parameters)
        return self._roughly[parameters]

    def _search(self, parameters: int) -> Minimum:
        """Search on block means; of a long recording on coarser means first, as far as they explain it."""
        theta, most, iterations = self._first, MOST_ITERATIONS, 0
        if len(self._thin.series) > MANY_MEANS:
            coarse = minimise(
                _problem(*self._means(COARSE_HZ), self._gravity), theta, parameters, self._prior, until=ROUGHLY
            )
            if coarse.nis < self.most_nis:
                theta, iterations = coarse.theta, coarse.iterations
                most = MOST_ITERATIONS if coarse.converged else 0
        minimum = minimise(self._thin, theta, parameters, self._prior, until=ROUGHLY, most=most)
        return replace(minimum, iterations=iterations + minimum.iterations)

    @cached_property
    def most_nis(self) -> float:
        """Largest mean ||e||^2 of white noise, by chance of as many samples and of those that tell its variance."""
        variance = 2.0 * WHITE_NIS * (1.0 / len(self._problem.series) + 1.0 / self._flat.n)
        return WHITE_NIS + MOST_STD * float(np.sqrt(variance))

    @cached_property
    def _first(self) -> Theta:
        return initialise(self._thin, self._flat.b_omega)

    @cached_property
    def _problem(self) -> Problem:
        return _problem(self.recording, self._flat, self._gravity)

    @cached_property
    def _thin(self) -> Problem:
        """Problem of means over blocks, which lose little where the noise is white."""
        return _problem(*self._means(SEARCH_HZ), self._gravity)

    def _means(self, rate_hz: float) -> tuple[Recording, Flat]:
        thin, at = downsampled(self.recording, self._flat, rate_hz)
        return thin, flat_statistics(thin, at)


def _problem(recording: Recording, flat: Flat, gravity: float) -> Problem:
    return Problem(mask(Series.after(recording, flat), recording, flat), flat, gravity)


def _with_errors(problem: Problem, errors: Errors) -> Problem:
    """Return the problem with errors of the sensors."""
    series, flat = problem.series, problem.flat
    if errors.kappa > 0.0:
        turned = series.dt * lengths(series.omega - flat.b_omega)
        q_extra = 0.0 if series.q_extra is None else series.q_extra
        series = replace(series, q_extra=q_extra + errors.kappa**2 * turned)
    return replace(problem, series=series, flat=replace(flat, Sigma_a=flat.Sigma_a + errors.floor**2))
