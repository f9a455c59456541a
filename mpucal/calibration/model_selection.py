"""Selection of the model, and the models `accel` and `imu` of a sensor that turns in place.

The simplest model that explains the data is selected: by the mean squared innovation, for K by a Wald test, and for a
lever arm by a score test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from itertools import product
from typing import NamedTuple

import numpy as np

from ..data import Recording
from ..rests.flat import Flat, flat_statistics
from .downsampling import SEARCH_HZ, downsampled
from .fit import Fit
from .hand import PASSES, HandFit, fit_hand
from .hypothesis_tests import MOST_STD, WALD_99, HandEffects, by_filter, find_hand_effects, undetermined, wald
from .initial_estimate import initialise
from .levenberg_marquardt import LAST, MOST_ITERATIONS, ROUGHLY, Minimum, minimise
from .likelihood import evaluate, slope_by_noise
from .masks import mask
from .paper import fit_paper
from .parameters import ACCEL, IMU
from .preprocessing import smoothed_rates
from .problem import Problem, Series
from .rotation import lengths
from .sampling import with_sampling_errors
from .scores import ends_of, parts_of
from .static import fit_static
from .theta import Prior, Theta
from .tilt import fit_tilt

# The mean ||e||^2 of white noise is 3; a hand, or a gyroscope's scale, makes it tens to thousands. Above this, white
# noise is not searched for on all samples. It is the value of means over blocks, in which white noise averages out, and
# a hand's motion does not.
HOPELESS_NIS = 10.0


class Errors(NamedTuple):
    """Model errors beyond the noise at rest: angle random walk and white-noise floor.

    kappa : rad per square root of a rad, random walk with the angle turned (nonlinearity, steps too long for a turn).
    floor : m/s^2, white noise in addition to the accelerometer's own.
    """

    kappa: float = 0.0
    floor: float = 0.0


NO_ERRORS = Errors()
ERRORS = tuple(Errors(kappa, floor) for kappa in (0.0, 1e-4, 3e-4, 1e-3) for floor in (0.0, 1e-3, 3e-3, 1e-2))


class ModelChoice(NamedTuple):
    """Chosen model: what was fitted, the model's name, and why it was chosen."""

    found: Fit | HandFit
    model: str
    why: str

    @property
    def plain(self) -> Fit:
        """The fit, with the covariance by the model alone."""
        return self.found.fit if isinstance(self.found, HandFit) else self.found

    def honest(self) -> Fit:
        """Return the fit with its honest covariance."""
        return self.found.honest() if isinstance(self.found, HandFit) else self.found


def fit_in_place(parameters: int, recording: Recording, flat: Flat, gravity: float) -> Fit:
    """Estimate D, b_a, b_omega and the first tilts (ACCEL: the paper's model, made efficient), and K as well (IMU)."""
    return InPlaceFits(recording, flat, gravity).fit(parameters)


METHODS: Mapping[str, Callable[[Recording, Flat, float], Fit | HandFit]] = {
    "hand": fit_hand,
    "imu": partial(fit_in_place, IMU),
    "accel": partial(fit_in_place, ACCEL),
    "paper": fit_paper,
    "tilt": fit_tilt,
    "static": fit_static,
}


def fit_model(recording: Recording, flat: Flat, gravity: float, model: str) -> ModelChoice:
    """Fit the model of a name, or for "auto" the simplest one that explains the data."""
    if model == "auto":
        return choose_model(recording, flat, gravity)
    return ModelChoice(METHODS[model](recording, flat, gravity), model, "asked for")


def choose_model(recording: Recording, flat: Flat, gravity: float) -> ModelChoice:
    """Choose the simplest model that explains the data.

    White noise and a trusted gyroscope come first, then its matrix K; then the same with small errors of both sensors.
    K is kept where a Wald test finds it different from the identity. Data that none of them explains, or that show a
    lever arm, were measured in a hand.
    """
    in_place = InPlaceFits(recording, flat, gravity)
    chosen = in_place.choose()
    if isinstance(chosen, ModelChoice):
        return chosen
    hand = fit_hand(recording, flat, gravity)
    kept = "K" if "K_xx" in hand.fit.names else "no K (it is not significantly different from the identity)"
    return ModelChoice(hand, "hand", f"{chosen}: a hand's model, with {kept}")


class InPlaceFits:
    """Fits of a sensor that turns in place, by the exact filter, to one recording."""

    def __init__(
        self, recording: Recording, flat: Flat, gravity: float, filtered: tuple[float, Theta] | None = None
    ) -> None:
        self._recording, self._flat, self._gravity, self._filtered = recording, flat, gravity, filtered
        self._without_matrix = Prior.of_sensor(flat, recording.sensor)
        self._roughly: dict[int, Minimum] = {}

    def choose(self) -> ModelChoice | str:
        """Return the simplest model that explains the data, or why none does."""
        least = np.inf
        for erring, parameters in product((False, True), (ACCEL, IMU)):
            if erring and parameters == ACCEL and not self._errors_may_explain():
                break
            minimum, errors = self._explain(parameters, erring)
            least = min(least, minimum.nis)
            if minimum.nis < self._most_nis:
                if parameters == ACCEL:
                    minimum = self._fit_matrix(minimum, errors) or minimum
                of_means, step_s = _with_errors(self._thin, errors), 1.0 / self._recording.rate_hz
                hand = find_hand_effects(of_means, *self._thin_means, minimum, self._without_matrix, step_s)
                if hand.spread_s2 and self._filtered is None:
                    filtered = hand.spread_s2, minimum.theta
                    return InPlaceFits(self._recording, self._flat, self._gravity, filtered).choose()
                if hand.likely is not None:
                    return f"the data show {hand.likely}"
                return self._chosen(minimum, errors, hand)
        return f"white noise does not explain the data (innovations {least:.0f}, expected 3)"

    def _chosen(self, minimum: Minimum, errors: Errors, hand: HandEffects) -> ModelChoice:
        perfect = len(minimum.free) == ACCEL
        noise = "white noise" if errors == NO_ERRORS else "white noise with small errors of the sensors"
        gyroscope = "a perfect gyroscope explain" if perfect else "a gyroscope that is not perfect explain"
        why = f"{noise} and {gyroscope} the data (innovations {minimum.nis:.1f}, expected 3)"
        fit, at = self._as_fit(minimum, errors), minimum.theta.moved(hand.shift)
        covariance = fit.covariance + hand.covariance
        fit = replace(fit, D=at.D, b_a=at.b_a, b_omega=at.b_omega, K=at.K, covariance=covariance)
        return ModelChoice(fit, "accel" if perfect else "imu", why)

    def _errors_may_explain(self) -> bool:
        """Return True if errors of the largest size could explain the data."""
        squares = evaluate(_with_errors(self._thin, ERRORS[-1]), self._rough(IMU).theta, 0).squares
        return squares < HOPELESS_NIS * (self._thin.flat.last + len(self._thin.series))

    def fit(self, parameters: int) -> Fit:
        """Fit with white noise alone, whether or not it explains the data."""
        return self._as_fit(self._minimum(parameters, self._rough(parameters)), NO_ERRORS)

    def _explain(self, parameters: int, erring: bool) -> tuple[Minimum, Errors]:
        """Return the minimum, a rough one where it explains nothing, and the most likely errors."""
        errors = NO_ERRORS
        minimum = self._rough(parameters)
        for _ in range(PASSES if erring else 0):
            theta = minimum.theta
            errors = min(ERRORS, key=lambda these: evaluate(_with_errors(self._thin, these), theta, 0).V)
            minimum = self._search(parameters, theta, errors)
        if minimum.nis < HOPELESS_NIS:
            minimum = self._minimum(parameters, minimum, errors)
        return minimum, errors

    def _minimum(self, parameters: int, near: Minimum, errors: Errors = NO_ERRORS) -> Minimum:
        """Search on the samples from the end of a rough search; if that did not converge, evaluate without a step.

        Without K, which turns may hardly show, V is so nearly quadratic that its first evaluation mostly is the last.
        """
        problem, most = _with_errors(self._problem, errors), MOST_ITERATIONS if near.converged else 0
        search = partial(minimise, unseen=5.0 * LAST) if parameters == ACCEL else minimise
        minimum = search(problem, near.theta, parameters, self._prior(parameters), most=most, ends=ends_of(problem))
        return replace(minimum, iterations=near.iterations + minimum.iterations)

    def _fit_matrix(self, near: Minimum, errors: Errors) -> Minimum | None:
        """Fit K as well; None where a Wald test does not find it different from the identity.

        The statistic is twice the fall of V: where the first decrement promises little, the search ends there.
        """
        problem = _with_errors(self._problem, errors)
        if not near.converged:
            return None
        # Twice the decrement estimates the statistic.
        first = minimise(problem, near.theta, IMU, self._prior(IMU), until=WALD_99 / 3.0, most=1)
        if first.iterations == 0:
            return None
        rough = self._search(IMU, first.theta, errors)
        imu = self._minimum(IMU, rough if rough.converged else near, errors)
        return imu if imu.converged and wald(imu) > WALD_99 else None

    def _as_fit(self, minimum: Minimum, errors: Errors) -> Fit:
        """Return the fit with the scores of the recording's parts."""
        at_prior = undetermined(minimum.covariance()) if len(minimum.free) > ACCEL else ()
        prior = self._prior(len(minimum.free))
        return minimum.as_fit(at_prior, parts_of(_with_errors(self._problem, errors), minimum, prior))

    def _rough(self, parameters: int) -> Minimum:
        """Return the minimum on means over blocks, found once for each number of parameters."""
        if parameters not in self._roughly:
            begin = self._first if parameters == ACCEL else self._rough(ACCEL).theta
            self._roughly[parameters] = self._search(parameters, begin)
        return self._roughly[parameters]

    def _search(self, parameters: int, begin: Theta, errors: Errors = NO_ERRORS) -> Minimum:
        return minimise(_with_errors(self._thin, errors), begin, parameters, self._prior(parameters), until=ROUGHLY)

    def _prior(self, parameters: int) -> Prior:
        return self._without_matrix if parameters == ACCEL else self._with_matrix

    @cached_property
    def _with_matrix(self) -> Prior:
        """Prior with the slope by K that the noise of the rates takes away."""
        return replace(self._without_matrix, slope=slope_by_noise(self._thin, self._rough(ACCEL).theta))

    @cached_property
    def _most_nis(self) -> float:
        """Largest mean ||e||^2 that white noise has by chance.

        By chance vary the mean over the samples, and the variance that was estimated from those of the flat segment.
        """
        variance = 2.0 * 3.0 * (1.0 / len(self._problem.series) + 1.0 / self._problem.flat.n)
        return 3.0 + MOST_STD * float(np.sqrt(variance))

    @cached_property
    def _first(self) -> Theta:
        return initialise(self._thin, self._flat.b_omega)

    @cached_property
    def _problem(self) -> Problem:
        # In a faster stream, noise that a chip's filter leaves hardly changes from sample to sample: it is not white.
        return self._unfiltered(*self._means(5.0 * SEARCH_HZ))

    @cached_property
    def _thin_means(self) -> tuple[Recording, Flat]:
        return self._means(SEARCH_HZ)

    @cached_property
    def _thin(self) -> Problem:
        return self._unfiltered(*self._thin_means)

    def _unfiltered(self, recording: Recording, flat: Flat) -> Problem:
        """Return the problem without what the sensors' filters took of a gravity that turned, if that is known."""
        problem = _problem(recording, flat, self._gravity)
        if self._filtered is None:
            return problem
        (spread_s2, theta), series = self._filtered, problem.series
        y, omega = by_filter(series.y, *smoothed_rates(recording, flat), theta)
        return replace(
            problem, series=replace(series, y=series.y - spread_s2 * y, omega=series.omega - spread_s2 * omega)
        )

    def _means(self, rate_hz: float) -> tuple[Recording, Flat]:
        """Return means over blocks, which lose little where the noise is white."""
        means, at = downsampled(self._recording, self._flat, rate_hz)
        return means, self._flat if means is self._recording else flat_statistics(means, at)


def _problem(recording: Recording, flat: Flat, gravity: float) -> Problem:
    series = with_sampling_errors(mask(Series.after(recording, flat), recording, flat), recording, flat)
    return Problem(series, flat, gravity)


def _with_errors(problem: Problem, errors: Errors) -> Problem:
    """Return the problem with errors of the sensors."""
    series, flat = problem.series, problem.flat
    if errors.kappa > 0.0:
        turned = series.dt * lengths(series.omega - flat.b_omega)
        q_extra = 0.0 if series.q_extra is None else series.q_extra
        series = replace(series, q_extra=q_extra + errors.kappa**2 * turned)
    return replace(problem, series=series, flat=replace(flat, Sigma_a=flat.Sigma_a + errors.floor**2))
