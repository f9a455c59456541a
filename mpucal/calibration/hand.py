"""Estimator for a sensor in a hand: with the gyroscope's matrix, a lever arm, and the hand's own acceleration.

A rough search on means over blocks finds theta and the noise of the hand, that is, its own acceleration while it moves.
It tries white noise first. If its most likely size is zero (a bench, or a hand that only jerks), there is no such
noise. Else the noise is coloured. With many rests it is white noise with a correlation time. With few rests the board
turns about a pivot, such as a wrist, and the noise is the second derivative of the pivot's bounded position.

A fit of all samples begins where the search ended. After each of the two, changes of the gyroscope's bias are found
and removed (bias_changes.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat
from ..rests.windows import noise_ratio
from .bias_changes import without_changes
from .downsampling import SEARCH_HZ, blocks, downsampled, means
from .fit import Fit
from .hand_noise import (
    CALM_MPS2,
    FARTHER,
    FIRST_MPS2,
    HAND_MPS2,
    PIVOT_MPS2,
    SLOWLY_PER_S,
    WHITE_MPS2,
    Noise,
    most_likely_sigma,
    remove_tremor,
    vibration_sigma,
)
from .hypotheses import CHANGES, Explanation, gyroscope_change, rank, remove_change
from .hypothesis_tests import WALD_99, undetermined, wald
from .initial_estimate import initialise, perfect
from .levenberg_marquardt import ROUGHLY, Minimum, information, minimise
from .likelihood import evaluate, value
from .parameters import HAND
from .preprocessing import Preprocessed, find_rests, prepare
from .problem import Problem
from .scores import ends_of, parts_of
from .slip import find_slip
from .theta import Prior, Theta
from .transitions import (
    Transition,
    are_explained,
    each_variance,
    leverages,
    miss_variances,
    over_spans,
    q_scale,
    transitions_of,
)

MOST_ITERATIONS = 20  # of a rough search
PASSES = 3


@dataclass(frozen=True)
class HandFit:
    """Fit of a hand's model.

    Attributes
    ----------
    fit : with the covariance by the model alone; `honest` computes the other one. minimum : where it ended.
    noise : of the hand as it moves. search : the rough search from which the fit began. fine : all samples.
    """

    fit: Fit
    minimum: Minimum
    noise: Noise
    search: _Search
    fine: Preprocessed

    @property
    def changes(self) -> tuple[Explanation, ...]:
        """Changes of the gyroscope's bias that were removed before the fit."""
        return self.search.changes

    def without(self, change: Explanation) -> HandFit:
        """Remove one more change from the recording, and fit it from the beginning.

        The present fit is no start for that: the change may have led it far from the truth.
        """
        return _fit(*self.search.scales_without(change))

    def honest(self) -> Fit:
        """Return the fit with its honest covariance, see _with_honest_information; it takes a quarter of the work."""
        minimum = _with_honest_information(self.minimum, self.noise, self.search.prepared, self.fine)
        covariance = minimum.covariance()
        known = undetermined(covariance) if minimum.free.all() else ()
        return replace(self.fit, covariance=covariance[np.ix_(minimum.free, minimum.free)], at_prior=known)


def fit_hand(recording: Recording, flat: Flat, gravity: float) -> HandFit:
    """Estimate D, b_a, b_omega, K, lever arm r and delay tau of a sensor that a hand moves.

    A turn that the gyroscope missed can spoil the first estimate. A fit that does not converge begins once more, from
    a perfect sensor.
    """
    return _fit(_Scales(recording, flat, gravity))


def _fit(scales: _Scales, changes: tuple[Explanation, ...] = ()) -> HandFit:
    """Fit a recording from which changes of the gyroscope's bias were removed, as fit_hand does."""
    begin = scales.rough.problem, scales.rough.flat.b_omega
    found = _fit_samples(without_changes(_Search(scales, initialise(*begin), changes)))
    if found.fit.converged:
        return found
    again = _fit_samples(without_changes(_Search(scales, perfect(*begin), changes)))
    return again if again.fit.converged else found


class _Scales:
    """Recording on two time scales: means over blocks for the rough search, and all samples for the last fit."""

    def __init__(self, recording: Recording, flat: Flat, gravity: float) -> None:
        self.recording, self.flat, self.gravity = recording, flat, gravity
        self._without_drift, self._runs = find_rests(recording, flat)
        self._noise_factor = noise_ratio(self._without_drift, flat.Sigma_a)

    @cached_property
    def fine(self) -> Preprocessed:
        """Samples of the whole recording, each by itself."""
        at = self.flat.first, self.flat.last
        return prepare(self._without_drift, at, self._runs, self.gravity, self._noise_factor)

    @cached_property
    def rough(self) -> Preprocessed:
        """Means over blocks."""
        recording, flat = self._without_drift, self.flat
        thin, at = downsampled(recording, flat, SEARCH_HZ)
        of_means = means(self._noise_factor, recording, flat, SEARCH_HZ)
        return prepare(thin, at, blocks(self._runs, recording, flat, SEARCH_HZ), self.gravity, of_means)


def _fit_samples(search: _Search) -> HandFit:
    """Fit all samples, from where a search ended."""
    fine, theta, noise = search.scales.fine, search.theta, search.noise
    if search.trembles:
        fine = remove_tremor(fine)
    fine = fine.with_rates_by(theta.K)
    if noise.kind == "white":  # means over blocks hide jerks and some of the hand's noise, so its size is found again
        noise = Noise("white", most_likely_sigma(fine.white, CALM_MPS2, theta, noise.sigma))
    problem, minimum = _settle(fine, noise, theta)
    iterations, vibration = search.iterations + minimum.iterations, vibration_sigma(fine, noise, minimum)
    if vibration > 0.0:
        fine = fine.vibrating(vibration)
        problem, minimum = _settle(fine, noise, theta)
        iterations += minimum.iterations
    prior = fine.prior()
    if wald(minimum) < WALD_99 and not undetermined(minimum.covariance()):
        trusted = replace(minimum.theta, K=np.eye(3))
        minimum = minimise(problem, trusted, HAND, prior, fixed=("K",), frozen=True, ends=ends_of(problem))
        iterations += minimum.iterations
    transitions = transitions_of(fine, minimum.theta)
    spoilt = (fine.recording.gap | fine.recording.gyr_clipped)[fine.flat.last :]
    slip, slipped = find_slip(transitions, fine, minimum.theta, spoilt)
    # A slip may be a different change in truth. So the misses after the slip give the noise, by which the parts' scores
    # are weighted; then all hypotheses can explain what looks like a slip.
    weighed = _with_each_variance(problem, minimum, transitions if slip is None else slip.transitions)
    fit = replace(minimum, iterations=iterations).as_fit(parts=parts_of(*weighed, prior))
    return HandFit(replace(fit, slip=slip, slipped=slipped), minimum, noise, search, fine)


def _settle(fine: Preprocessed, noise: Noise, theta: Theta) -> tuple[Problem, Minimum]:
    """Return the problem of all samples and its minimum, from the theta at which a rough search ended."""
    problem = _with_transition_noise(noise.problem(fine), fine, theta)
    return problem, minimise(problem, theta, HAND, fine.prior(), frozen=True, ends=ends_of(problem))


def _with_honest_information(minimum: Minimum, noise: Noise, rough: Preprocessed, fine: Preprocessed) -> Minimum:
    """Return the minimum with an honest H, the Fisher information by a noise that is not too small.

    After the fit the transitions between rests miss by less than the gyroscope's error, since few transitions and many
    parameters leave few degrees of freedom. So the noise of the transitions is estimated again, divided by the degrees
    of freedom that are left. The estimate stays, since it would not improve.
    """
    if noise.kind == "none":
        return minimum
    if noise.kind == "pivot":
        noise = replace(noise, lam=SLOWLY_PER_S)
    prior, fixed = fine.prior(), () if minimum.free.all() else ("K",)
    at, problem, transitions = minimum, noise.problem(rough), transitions_of(rough, minimum.theta)
    variance, leverage = miss_variances(transitions), np.zeros(1)
    for _ in range(PASSES if transitions else 0):
        leverage = leverages(transitions, rough, at.theta, at.covariance(), variance)
        variance = miss_variances(transitions, leverage)
        problem = _scaled(problem, q_scale(transitions, variance, len(problem.series)))
        before, at = at, _roughly(problem, at.theta, prior, fixed)
        if at.theta is not before.theta:
            transitions = transitions_of(rough, at.theta)
    problem, transitions = noise.problem(fine), transitions_of(fine, at.theta)
    if transitions:  # one that begins as the flat segment ends may be there alone
        variance = miss_variances(transitions, float(leverage.mean()))
        problem = _scaled(problem, q_scale(transitions, variance, len(problem.series)))
    return replace(minimum, H=information(problem, minimum.theta, prior))


def _with_transition_noise(problem: Problem, prepared: Preprocessed, theta: Theta) -> Problem:
    """Return the problem with the noise of the gyroscope between rests that explains the transitions under theta."""
    transitions = transitions_of(prepared, theta)
    if not transitions:
        return problem
    return _scaled(problem, q_scale(transitions, miss_variances(transitions), len(problem.series)))


def _with_each_variance(
    problem: Problem, minimum: Minimum, transitions: Sequence[Transition]
) -> tuple[Problem, Minimum]:
    """Return the problem in which each transition has a variance of its own, and the minimum evaluated in it.

    The estimate stays: with so few transitions it would follow some and ignore others.
    """
    ends = ends_of(problem)
    if not transitions or ends is None:
        return problem, minimum
    variance, share = each_variance(transitions)
    if np.allclose(variance, [each.variance for each in transitions]):
        return problem, minimum
    n, extra = len(problem.series), problem.series.r_extra
    problem = _scaled(problem, q_scale(transitions, variance, n))
    if extra is not None:
        more = 1.0 + over_spans(transitions, (1.0 / share - 1.0).tolist(), n)
        problem = replace(problem, series=replace(problem.series, r_extra=extra * more))
    seen = minimum.theta, evaluate(problem, minimum.theta, len(minimum.free), ends)
    return problem, replace(minimum, seen=seen, last=np.zeros_like(minimum.last))


def _scaled(problem: Problem, factor: Vector) -> Problem:
    """Return the problem with the gyroscope's noise multiplied by `factor` (n,)."""
    return replace(problem, series=replace(problem.series, q_scale=factor))


class _Search:
    """Rough search, on means over blocks, for theta and the hand's noise in turn.

    Attributes
    ----------
    theta, noise : where it ended. changes : of the gyroscope's bias, removed before.
    trembles : True if the hand's tremor turns the board about a lever arm of its own. prepared : the means over blocks,
        without the tremor if it `trembles`.
    """

    def __init__(self, scales: _Scales, begin: Theta, changes: tuple[Explanation, ...] = ()) -> None:
        self.scales, self.prepared, self.changes = scales, scales.rough, changes
        self.iterations = 0
        self.trembles = False
        self._prior = self.prepared.prior()
        self.theta, self.noise = self._run(begin)
        vibration = vibration_sigma(self.prepared, self.noise, self._last[1])
        if vibration > 0.0:
            self.prepared, self.trembles = scales.rough.vibrating(vibration), False
            self.theta, self.noise = self._run(begin)

    def cost(self) -> float:
        """Return the cost function (8) where the search ended."""
        return self._last[1].V

    def find_change(self) -> Explanation | None:
        """Return the change of the gyroscope's bias that explains the residuals of the search, or None.

        None is also returned where the search failed, or the gyroscope's noise explains the transitions between rests.
        """
        transitions = transitions_of(self.prepared, self.theta)
        if not self._last[1].converged or are_explained(transitions):
            return None
        weighed = _with_each_variance(*self._last, transitions)
        return gyroscope_change(rank(parts_of(*weighed, self._prior), self.theta.D, CHANGES))

    def without(self, change: Explanation) -> _Search:
        """Remove one more change from the recording, and search again from where this search ended."""
        scales, changes = self.scales_without(change)
        return _Search(scales, self.theta, changes)

    def scales_without(self, change: Explanation) -> tuple[_Scales, tuple[Explanation, ...]]:
        """Remove one more change from the recording; return it, and all changes that were removed."""
        scales = self.scales
        recording = remove_change(scales.recording, scales.flat, change)
        return _Scales(recording, scales.flat, scales.gravity), (*self.changes, change)

    def _run(self, theta: Theta) -> tuple[Theta, Noise]:
        """Search with Huber's loss, which converges from afar, then with the redescending loss and the best sigma."""
        prepared = self.prepared
        theta = self._roughly(replace(prepared.white(FIRST_MPS2), tail=0.0), theta)
        sigmas = HAND_MPS2 if prepared.rests_often else WHITE_MPS2
        first = most_likely_sigma(prepared.white, sigmas, theta, FIRST_MPS2)
        theta = self._roughly(prepared.white(first), theta)
        sigma = most_likely_sigma(prepared.white, sigmas, theta, first)
        if sigma != first:
            theta = self._roughly(prepared.white(sigma), theta)
        if sigma == 0.0:
            return theta, Noise("none", 0.0)
        noise = Noise("white", sigma)
        if not prepared.rests_often:
            theta, noise = self._fit_pivot(theta)
        for _ in range(PASSES):
            problem = _with_transition_noise(noise.problem(self.prepared), self.prepared, theta)
            before, theta = theta, self._roughly(problem, theta)
            if theta is before:
                break
        return theta, noise

    def _fit_pivot(self, theta: Theta) -> tuple[Theta, Noise]:
        """Fit a pivot's travel, and a lever arm of the tremor if that lowers the BIC despite three parameters more.

        This decides `trembles`, and sets `prepared`.
        """
        theta, noise = self._fit_travel(theta)
        one, theta = self.prepared, self._roughly(noise.problem(self.prepared), theta)
        two = remove_tremor(one)
        there = self._roughly(noise.problem(two), theta)
        if _least_cost(two, there) + 1.5 * math.log(len(two.problem.series)) > _least_cost(one, theta):
            return theta, noise
        self.prepared, self.trembles = two, True
        return self._fit_travel(there)

    def _fit_travel(self, theta: Theta) -> tuple[Theta, Noise]:
        """Fit theta and the most likely size of a pivot's travel."""
        pivot = self.prepared.pivot
        sigma = most_likely_sigma(pivot, PIVOT_MPS2, theta, PIVOT_MPS2[0])
        theta = self._roughly(pivot(sigma), theta)
        return theta, Noise("pivot", FARTHER * most_likely_sigma(pivot, PIVOT_MPS2, theta, sigma))

    def _roughly(self, problem: Problem, theta: Theta) -> Theta:
        """Fit roughly; keep the problem and its minimum as the last ones, and count the iterations."""
        minimum = _roughly(problem, theta, self._prior)
        self.iterations += minimum.iterations
        self._last = problem, minimum
        return minimum.theta


def _roughly(problem: Problem, theta: Theta, prior: Prior, fixed: tuple[str, ...] = ()) -> Minimum:
    return minimise(problem, theta, HAND, prior, fixed, until=ROUGHLY, most=MOST_ITERATIONS, frozen=True)


def _least_cost(prepared: Preprocessed, theta: Theta) -> float:
    """Return V at theta, with the size of a pivot's travel for which it is least."""
    return value(prepared.pivot(most_likely_sigma(prepared.pivot, PIVOT_MPS2, theta, PIVOT_MPS2[0])), theta)
