"""Levenberg-Marquardt on V(theta) plus a quadratic prior, with the Fisher matrix for the Hessian.

Source: Nocedal, Wright, "Numerical Optimization" (2006), section 10.3; Marquardt's scaling by the diagonal of H.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..data import Mask, Vector
from .fit import Fit
from .likelihood import Evaluation, evaluate
from .normal_equations import inverse, solve
from .parameters import HAND, NAMES, PLACES, SENSITIVE
from .parts import Parts
from .problem import Problem
from .theta import Prior, Theta

DECREMENT = 1e-3  # g' H^-1 g / 2: 0.04 standard deviations from the optimum, whatever the units
ROUGHLY = 0.05  # the decrement at which a search on block means ends
# Below this many times the decrement that ends a search, a whole step leaves nearly nothing of it: not evaluated.
LAST = 30.0
MOST_ITERATIONS = 60
# A trial that leaves less than this share of the decrement is progress. After this many without any the search has
# failed, as in a valley without an end: turns so slow that the gyroscope's noise loses gravity. Estimates that converge
# make some within 5 trials.
PROGRESS, MOST_IN_VAIN = 0.5, 10
# V may rise by so much in a step with frozen gains, and by more in one that is progress: its minimum is elsewhere, most
# of all after an interruption.
FROZEN_SLACK, SLACK_OF_PROGRESS = 1.0, 200.0
DAMPING, EASIER, HARDER = 1e-3, 0.1, 8.0


@dataclass(frozen=True)
class Minimum:
    """Point where the minimiser stopped.

    Attributes
    ----------
    theta : the estimate. V : its cost with the prior. nis : mean of e' S^-1 e over the samples.
    H : (p, p) Fisher matrix with the prior's, over all p parameters, including those held fixed.
    free : (p,) True where a parameter was estimated.
    seen : the last evaluation, and its theta. last : (p,) the step from there to `theta`, which was not evaluated.
    """

    theta: Theta
    V: float
    nis: float
    H: Vector
    free: Vector
    iterations: int
    converged: bool
    seen: tuple[Theta, Evaluation]
    last: Vector

    def covariance(self) -> Vector:
        """Return the inverse (p, p) of H over the free parameters; zero for those held fixed."""
        covariance = np.zeros_like(self.H)
        free = np.ix_(self.free, self.free)
        covariance[free] = inverse(self.H[free])
        return covariance

    def as_fit(self, at_prior: tuple[str, ...] = (), parts: Parts | None = None, spread: float = 1.0) -> Fit:
        """Return the estimate of the free parameters, with `spread` times the standard deviations of H."""
        theta, covariance = self.theta, spread**2 * self.covariance()
        return Fit(
            D=theta.D,
            b_a=theta.b_a,
            b_omega=theta.b_omega,
            K=theta.K,
            names=tuple(name for name, kept in zip(NAMES, self.free, strict=False) if kept),
            covariance=covariance[np.ix_(self.free, self.free)],
            iterations=self.iterations,
            converged=self.converged,
            nis=self.nis,
            V=self.V,
            at_prior=at_prior,
            parts=parts,
            delay_s=theta.tau,
        )


def minimise(
    problem: Problem,
    theta: Theta,
    parameters: int,
    prior: Prior,
    fixed: tuple[str, ...] = (),
    *,
    until: float = DECREMENT,
    most: int = MOST_ITERATIONS,
    frozen: bool = False,
    unseen: float = LAST,
    ends: NDArray[np.int64] | None = None,
) -> Minimum:
    """Minimise V + prior over the first `parameters` of NAMES, those of `fixed` (keys of PLACES) excepted.

    The search stops where the Newton decrement g' H^-1 g / 2 falls below `until`, after `most` iterations, or where it
    no longer falls. Below `unseen` times `until` a whole step is the last, and is not evaluated. With `frozen` gains
    the gradient is not exactly that of V, and a step that brings it nearer to zero is accepted, too. Evaluations give
    sums up to `ends` as well, see evaluate.
    """
    free = np.ones(parameters, bool)
    for name in fixed:
        free[PLACES[name]] = False
    at, damping, iterations, converged = _At(problem, theta, free, prior, ends), DAMPING, 0, False
    least, in_vain, last = np.inf, 0, np.zeros(parameters)
    while iterations < most and in_vain < MOST_IN_VAIN:
        gradient, H, decrement = at.gradient, at.free_H, at.decrement
        least, in_vain = (decrement, 0) if decrement < PROGRESS * least else (least, in_vain + 1)
        if decrement < until:
            converged = True
            break
        step = np.zeros(parameters)
        if decrement < unseen * until:
            last[free] = at.newton
            converged, iterations = True, iterations + 1
            break
        step[free] = -solve(H + damping * np.diag(np.diag(H)), gradient)
        trial = _At(problem, at.theta.moved(step), free, prior, ends)
        if trial.V < at.V or (frozen and _nearer(trial, at)):
            at, damping, iterations = trial, damping * EASIER, iterations + 1
        elif not frozen and -float(gradient @ step[free]) < until:
            converged = True  # nor does V fall along the gradient
            break
        else:
            damping *= HARDER
    theta, V = (at.theta.moved(last), at.V - decrement) if last.any() else (at.theta, at.V)
    nis = at.data.squares / max(len(problem.series), 1)
    return Minimum(theta, V, nis, at.H, free, iterations, converged, (at.theta, at.data), last)


def _nearer(trial: _At, at: _At) -> bool:
    """Return True if a step came nearer to the root of the gradient with frozen gains."""
    shrunk, risen = trial.decrement / at.decrement, trial.V - at.V
    return shrunk < 1.0 and risen < (SLACK_OF_PROGRESS if shrunk < PROGRESS else FROZEN_SLACK)


class _At:
    """V and H at theta, with the prior's share; the gradient, and what follows from it, of the free parameters."""

    def __init__(
        self, problem: Problem, theta: Theta, free: Mask, prior: Prior, ends: NDArray[np.int64] | None
    ) -> None:
        self.theta, parameters = theta, len(free)
        self.data: Evaluation = evaluate(problem, theta, parameters, ends)
        self.V = self.data.V + prior.cost(theta, parameters)
        if not np.isfinite(self.V):
            self.V = np.inf
        self.H = self.data.fisher + np.diag(prior.precision[:parameters])
        self.free_H = self.H[np.ix_(free, free)]
        self.gradient = (self.data.gradient + prior.gradient(theta, parameters))[free]

    @cached_property
    def newton(self) -> Vector:
        """Newton's step."""
        return -solve(self.free_H, self.gradient)

    @cached_property
    def decrement(self) -> float:
        """Newton decrement g' H^-1 g / 2, by which V would still fall."""
        return -0.5 * float(self.gradient @ self.newton)


def information(problem: Problem, theta: Theta, prior: Prior) -> Vector:
    """Return the Fisher matrix (p, p) of the hand's filter over all parameters, with the prior's.

    The gyroscope's sensitivity to acceleration is eliminated. The data sheet's tolerance is the prior of these nine
    numbers, of which the rests in a hand seldom show enough.
    """
    F = evaluate(problem.with_forces(), theta, SENSITIVE).fisher + np.diag(prior.precision_with_sensitivity)
    across = F[:HAND, HAND:]
    return np.asarray(F[:HAND, :HAND] - across @ np.linalg.solve(F[HAND:, HAND:], across.T))
