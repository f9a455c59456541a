"""Sensitivity of the gyroscope to acceleration, in a recording without the rests that would show it.

A machine may turn a sensor without a pause. S (3, 3) is then estimated together with theta, by the method of
Gauss-Newton on the innovations of the hand's filter: the rates are omega - S (y - y_flat), since b_omega is the mean
rate of the flat segment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..data import Recording, Vector
from ..rests.flat import Flat, flat_statistics
from ..rests.gyro_drift import SENSITIVITY_SD
from ..rests.intervals import RestFinder
from .downsampling import SEARCH_HZ, downsampled
from .fit import Fit
from .hand import PASSES
from .hypotheses import SURE, Explanation, gyroscope_change, rank, unseen_changes
from .hypothesis_tests import most_chi2
from .levenberg_marquardt import DECREMENT, LAST
from .likelihood import evaluate, part_scores, slope_by_noise
from .model_selection import HOPELESS_NIS
from .normal_equations import inverse
from .parameters import HAND, NAMES, SENSITIVE
from .preprocessing import prepare
from .scores import ends_of, with_times
from .theta import Theta


class Sensitivity(NamedTuple):
    """Sensitivity of the rates to acceleration.

    S : (3, 3) rad/s per m/s^2, its mean. covariance : (p, p) that it adds to theta's, in the order of NAMES.
    """

    S: Vector
    covariance: Vector

    def removed_from(self, recording: Recording, flat: Flat) -> Recording:
        """Return the recording without it; the flat segment keeps its mean rate."""
        return replace(recording, gyr=recording.gyr - (recording.acc - flat.y) @ self.S.T)

    def held_by(self, fit: Fit) -> Fit:
        """Return the fit of the recording without it, with its uncertainty."""
        at = [NAMES.index(name) for name in fit.names]
        return replace(fit, covariance=fit.covariance + self.covariance[np.ix_(at, at)])


def find_sensitivity(
    recording: Recording, flat: Flat, gravity: float, fit: Fit, explanations: Sequence[Explanation]
) -> Sensitivity | None:
    """Return the sensitivity that the turns may show; None where they surely show none, or it does not explain them.

    Nor is it estimated where the rests suffice. The mixture of S, with the weight of its evidence among the
    explanations, and of 0 gives the covariance, and the mean to remove; that is 0 where 0 is likelier.

    fit : of any model with a gyroscope. explanations : of the fit, see hypotheses.py.
    """
    thin, at = downsampled(recording, flat, SEARCH_HZ)
    rest = flat_statistics(thin, at)
    # With the drift: from slow turns that pass for rests, it would be taken wrongly.
    prepared = prepare(thin, at, RestFinder(thin, rest).typical(), gravity)
    if prepared.rests_often and gyroscope_change(explanations) is None:  # a machine's slow turns pass for rests
        return None
    problem = replace(prepared.white(0.0), huber=np.inf).with_forces()
    series, ends = problem.series, ends_of(problem)
    assert series.force is not None
    if ends is None:
        return None
    up = np.linalg.solve(fit.D, flat.y - fit.b_a)
    start = Theta.start(fit.D, fit.b_a, fit.b_omega, up / np.linalg.norm(up))
    theta, S = replace(start, K=fit.K, tau=fit.delay_s), np.zeros((3, 3))
    prior = replace(prepared.prior(), slope=slope_by_noise(problem, theta))
    precision = prior.precision_with_sensitivity
    others = np.logaddexp.reduce([0.0, *(each.log_share for each in explanations)])  # nothing's share is 1
    for _ in range(PASSES):
        less = replace(problem, series=replace(series, omega=series.omega - series.force @ S.T))
        found = evaluate(less, theta, SENSITIVE, ends)
        H = found.fisher + np.diag(precision)
        C = inverse(H)
        gradient = found.gradient + np.append(prior.gradient(theta), SENSITIVITY_SD**-2 * S)
        step = -C @ gradient
        before, theta, S = theta, theta.moved(step[:HAND]), S + step[HAND:].reshape(3, 3)
        known, s = inverse(C[HAND:, HAND:]), S.ravel()
        evidence = 0.5 * float(s @ known @ s - np.linalg.slogdet(SENSITIVITY_SD**2 * known)[1])
        if not evidence > -np.log(SURE):
            return None
        if -0.5 * (step @ gradient) < LAST * DECREMENT:
            break
    left = found.squares + step @ (2.0 * found.gradient + found.fisher @ step)
    assert found.to_ends is not None
    beside = explanations
    if others > np.log(SURE):  # where nothing is likely without S, nothing is with it
        scores = part_scores(less, before, SENSITIVE, found.to_ends).moved(step)
        parts = with_times(less, theta, scores, H, np.zeros(SENSITIVE))
        beside = rank(parts, theta.D)
        change = gyroscope_change(beside)
        if change is not None:
            s, C = s + change.shift[0, HAND:], C + unseen_changes([change], parts, theta.D, prepared.rests_often)
            left -= 2.0 * change.evidence
    evidence += np.logaddexp.reduce([0.0, *(each.log_share for each in beside)])
    # No chip feels so much; a drift on a machine that turns evenly passes for it.
    beyond = s @ s > most_chi2(len(s)) * SENSITIVITY_SD**2
    if beyond or not left < HOPELESS_NIS * len(series):
        return None
    weight = np.exp(evidence - np.logaddexp(others, evidence))
    removed = weight if weight > 0.5 else 0.0
    carried = C[:HAND, HAND:] @ inverse(C[HAND:, HAND:])
    apart = weight * (1.0 - removed) ** 2 + (1.0 - weight) * removed**2
    covariance = weight * C[HAND:, HAND:] + apart * np.outer(s, s)
    return Sensitivity(removed * s.reshape(3, 3), carried @ covariance @ carried.T)
