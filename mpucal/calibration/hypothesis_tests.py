"""Statistical tests: how far chance goes, Wald's test of the gyroscope's matrix K, Rao's score test of a lever arm."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.linalg import norm

from ..data import Recording, Vector
from ..rests.flat import Flat
from ..result.correlation import UPPER
from .levenberg_marquardt import Minimum
from .likelihood import Evaluation, evaluate
from .normal_equations import inverse
from .parameters import BY_NAME, HAND, PLACES
from .preprocessing import smoothed_rates
from .problem import Problem
from .rotation import cross_rows
from .theta import Prior, Theta

K = BY_NAME["K"]
MOST_STD = 4.0  # standard deviations of a normal deviate, beyond which chance explains nothing
RARE_STD = 2.326  # those that chance exceeds in one case of a hundred: enough for parameters that do no harm
KNOWN = 0.5  # the data determine a parameter whose standard deviation they reduce to this share of the prior's
LEAST_LEVER_M = 0.004  # of a hand's model; the axes of one chip are a millimetre apart
LAG_S = 0.02  # delay by a chip's slowest filter; with one clock, filters leave 10 ms between the sensors at most


def most_chi2(n: int, deviate: float = MOST_STD) -> float:
    """Return chi^2 of n degrees of freedom that chance exceeds as rarely as a normal deviate exceeds `deviate`.

    Source: Wilson, Hilferty, PNAS 17 (1931).
    """
    return n * (1.0 - 2.0 / (9.0 * n) + deviate * math.sqrt(2.0 / (9.0 * n))) ** 3


WALD_99 = most_chi2(len(K.names), RARE_STD)  # below it, K is not significantly different from the identity


def wald(minimum: Minimum) -> float:
    """Return k' C_k^-1 k of k = K - I: chi^2 of six degrees of freedom where the gyroscope is perfect."""
    place = PLACES[K.name]
    k = minimum.theta.K[UPPER] - K.mean
    return float(k @ np.linalg.solve(minimum.covariance()[place, place], k))


def undetermined(covariance: Vector) -> tuple[str, ...]:
    """Return the names of K's elements that the data hardly determine, by the (p, p) covariance of a model with K."""
    variance = np.diag(covariance)[PLACES[K.name]]
    # A singular covariance may hold a negative variance.
    known = (variance > 0.0) & (variance <= (KNOWN * np.array(K.sd)) ** 2)
    return tuple(name for name, is_known in zip(K.names, known, strict=True) if not is_known)


class HandEffects(NamedTuple):
    """Effects of a lever arm r, a delay tau and the spread of the sensors' filters on an estimate by another model.

    Attributes
    ----------
    likely : what of them the data likely show, for a message; None where no other model is needed.
    shift : (p,) of the estimate, by the likeliest tau and spread. covariance : (p, p) that all of them add to it.
    spread_s2 : s^2, the spread where the data surely show one that is longer than a step of the samples, or 0.
    """

    likely: str | None
    shift: Vector
    covariance: Vector
    spread_s2: float


def find_hand_effects(
    problem: Problem, recording: Recording, flat: Flat, minimum: Minimum, prior: Prior, step_s: float
) -> HandEffects:
    """Return whether the data likely show a lever arm r, or a delay tau against its prior, and what these change.

    The statistic of r is g' S^-1 g: g is the gradient by r at r = 0 and S its information, both less what the
    parameters of the estimate take of them. S^-1 g is the step to r, and to tau likewise. The spread is the variance in
    time [s^2] of the impulse response of a filter, which is that of both sensors.

    Parameters
    ----------
    problem : of the recording, whose flat segment is `flat`. minimum : of a model without a lever arm.
    step_s : s, from sample to sample, of the recording before its downsampling.
    """
    S, g, taken = _weigh_effects(problem, smoothed_rates(recording, flat), minimum, prior)
    likely, r = None, -np.linalg.lstsq(S[:3, :3], g[:3], rcond=None)[0]
    if r @ S[:3, :3] @ r > most_chi2(3) and norm(r) > LEAST_LEVER_M:
        likely = f"a lever arm of {1e3 * norm(r):.0f} mm"
    information = max(S[3, 3], np.finfo(np.float64).tiny)  # of rates that never change it is 0, or rounded below that
    tau, expected, precision = -g[3] / information, *(x[PLACES["tau"]].item() for x in (prior.mean, prior.precision))
    # A rate may be that of the step before its sample, or of the step after.
    std = math.sqrt(1.0 / information + 1.0 / precision + (0.5 * step_s) ** 2)
    if abs(tau - expected) > MOST_STD * std:
        likely = f"a delay of {1e3 * tau:.0f} ms"
    # A low-pass filter spreads by about the square of its delay.
    precisions = np.array([*[(2.5 * LEAST_LEVER_M) ** -2] * 3, precision, LAG_S**-4])
    covariance = inverse(S + np.diag(precisions))
    of_means = (float(np.median(problem.series.dt)) ** 2 - step_s**2) / 12.0  # spread of means, which is no sensor's
    x = covariance @ (precisions * [0.0, 0.0, 0.0, expected, of_means] - g)
    x[4] -= of_means
    is_filtered = x[4] > max(MOST_STD * math.sqrt(covariance[4, 4]), step_s**2)  # less may be an error of sampling
    by_r = taken[:, :3] @ x[:3]  # an r that is not likely may be none, and only widens the uncertainty
    total = taken @ covariance @ taken.T + np.outer(by_r, by_r)
    return HandEffects(likely, by_r - taken @ x, total, float(x[4]) if is_filtered else 0.0)


def _weigh_effects(
    problem: Problem, rates: tuple[Vector, Vector], minimum: Minimum, prior: Prior
) -> tuple[Vector, Vector, Vector]:
    """Return information (5, 5) and gradient (5,) by r, tau and spread, less what the p estimated parameters take.

    The third is what they take (p, 5). rates : rate and angular acceleration (n, 3), smoothed.
    """
    n, theta, series = len(problem.series), minimum.theta, problem.series
    still = {"reset": np.full(n, -1.0), "jerk": np.zeros(n), "r_extra": np.zeros(n)}
    y, omega = by_filter(series.y, *rates, theta)

    def filtered(spread: float) -> Evaluation:
        moved = {"y": series.y - spread * y, "omega": series.omega - spread * omega}
        of_spread = replace(series, rate=rates[0], alpha=rates[1], **still, **moved)
        return evaluate(replace(problem, series=of_spread), theta, HAND)

    step = LAG_S**2
    less, at, more = map(filtered, (-step, 0.0, step))
    free, of_hand = np.flatnonzero(minimum.free), np.arange(HAND)
    p, lanes = len(free), np.concatenate([free, of_hand[PLACES["r"]], of_hand[PLACES["tau"]]])
    gradient = np.append(at.gradient[lanes], (more.V - less.V) / (2.0 * step))
    across = (more.gradient - less.gradient)[lanes] / (2.0 * step)
    curvature = (more.V - 2.0 * at.V + less.V) / step**2
    fisher = np.block([[at.fisher[np.ix_(lanes, lanes)], across[:, None]], [across, curvature]])
    taken = np.linalg.solve(fisher[:p, :p] + np.diag(prior.precision[free]), fisher[:p, p:])
    return fisher[p:, p:] - fisher[:p, p:].T @ taken, gradient[p:] - taken.T @ gradient[:p], taken


def by_filter(y: Vector, rate: Vector, alpha: Vector, theta: Theta) -> tuple[Vector, Vector]:
    """Return changes (n, 3) of readings y (n, 3) and of rates by the same filter, of unit spread, in both sensors.

    To second order, a filter adds half of the second derivative to what it delays: of gravity s in the body frame, that
    is omega x (omega x s) - alpha x s. The filtered rates lead to a body that is turned by alpha / 2, which explains
    the second term, if -omega x alpha / 2 is taken from them: turns about several axes do not commute.
    """
    s = (y - theta.b_a) @ theta.inverse.T
    return 0.5 * cross_rows(rate, cross_rows(rate, s)) @ theta.D.T, -0.5 * cross_rows(rate, alpha)
