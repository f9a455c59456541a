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
from .likelihood import evaluate
from .parameters import BY_NAME, HAND, PLACES
from .preprocessing import smoothed_rates
from .problem import Problem
from .theta import Prior

K = BY_NAME["K"]
MOST_STD = 4.0  # standard deviations of a normal deviate, beyond which chance explains nothing
RARE_STD = 2.326  # those that chance exceeds in one case of a hundred: enough for parameters that do no harm
KNOWN = 0.5  # the data determine a parameter whose standard deviation they reduce to this share of the prior's
LEAST_LEVER_M = 1e-3  # the axes of one chip are as far from each other


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
    """Effects of the parameters that only a hand's model estimates on an estimate by another model.

    Attributes
    ----------
    likely : what of them the data likely show, for a message; None where no other model is needed.
    shift : (p,) of the estimate, by the likeliest delay tau. covariance : (p, p) that an unknown tau adds to it.
    """

    likely: str | None
    shift: Vector
    covariance: Vector


def find_hand_effects(
    problem: Problem, recording: Recording, flat: Flat, minimum: Minimum, prior: Prior, step_s: float
) -> HandEffects:
    """Return whether the data likely show a lever arm r, or a delay tau against its prior, and what tau changes.

    The statistic of r is g' S^-1 g: g is the gradient by r at r = 0 and S its information, both less what the
    parameters of the estimate take of them. S^-1 g is the step to r, and to tau likewise.

    Parameters
    ----------
    problem : of the recording, whose flat segment is `flat`. minimum : of a model without a lever arm.
    step_s : s, from sample to sample, of the recording before its downsampling.
    """
    n = len(problem.series)
    rate, alpha = smoothed_rates(recording, flat)
    series = replace(
        problem.series, rate=rate, alpha=alpha, reset=np.full(n, -1.0), jerk=np.zeros(n), r_extra=np.zeros(n)
    )
    at = evaluate(replace(problem, series=series), minimum.theta, HAND)
    others = np.flatnonzero(minimum.free)
    H = at.fisher[np.ix_(others, others)] + np.diag(prior.precision[others])

    def beside(name: str) -> tuple[Vector, Vector, Vector]:
        """Return the step, S, and what the parameters take of them."""
        places = np.arange(HAND)[PLACES[name]]
        taken = np.linalg.solve(H, at.fisher[np.ix_(others, places)])
        S = at.fisher[np.ix_(places, places)] - at.fisher[np.ix_(places, others)] @ taken
        step = -np.linalg.lstsq(S, at.gradient[places] - taken.T @ at.gradient[others], rcond=None)[0]
        return np.asarray(step), S, np.asarray(taken)

    likely, (r, S, _) = None, beside("r")
    if r @ S @ r > most_chi2(len(r), RARE_STD) and norm(r) > LEAST_LEVER_M:
        likely = f"a lever arm of {1e3 * norm(r):.0f} mm"
    tau, S, taken = beside("tau")
    information = max(S.item(), np.finfo(np.float64).tiny)  # of rates that never change it is 0, or rounded below that
    expected, precision = prior.mean[PLACES["tau"]], prior.precision[PLACES["tau"]]
    # A rate may be that of the step before its sample, or of the step after.
    std = math.sqrt(1.0 / information + 1.0 / precision.item() + (0.5 * step_s) ** 2)
    if abs(tau - expected).item() > MOST_STD * std:
        likely = f"a delay of {1e3 * tau.item():.0f} ms"
    variance = 1.0 / (information + precision)
    shift = -taken @ (variance * (precision * expected + information * tau))
    return HandEffects(likely, shift, variance * taken @ taken.T)
