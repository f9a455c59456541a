"""Comparison of another accelerometer of the board with the first one, sample by sample: both feel the same motion.

Readings in coarse steps determine a rest to a step's rounding, however long it is. While the board is turned they cross
hundreds of steps, and the first accelerometer, once calibrated, says what they should be, gravity and the hand's own
acceleration alike:

    y = D (s + L r - tau ds/dt) + b_a + e                                         (19)

with s of the first accelerometer, and lever arm r and delay tau from it to the other one. The rates of both gyroscopes,
compared in the same way, tell how the axes of the other one are turned against the first one's, and how surely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
from ..rests.flat import QUIETEST_ACC_MPS2, UNVARIED
from ..result.error_model import nearest_rotation
from .evidence import Evidence
from .fit import Fit
from .hypothesis_tests import most_chi2
from .parameters import ACCELEROMETER, BY_NAME, MODELS, PLACES
from .preprocessing import HUBER, smoothed_rates
from .rotation import cross
from .sampling import STAYS_S
from .transitions import REWEIGHTED
from .uncertainty import UncertaintyClaim

APART_S = 0.05  # samples of the first one farther apart than this do not say what was in between
FEWEST = 1000  # samples in common
COMMON_S = 1.0  # errors of samples nearer than this may have one cause


def beside_first(first: Evidence, other: Evidence) -> Evidence:
    """Return the evidence of the other accelerometer, with D and b_a by the first one where that has finer readings.

    Its own estimate stays where either has a fault or a change, and where the two disagree.
    """
    finer = first.recording.sensor.steps[0] < other.recording.sensor.steps[0]
    if first.fit is None or other.fit is None or not (finer and _is_plain(first) and _is_plain(other)):
        return other
    own, compared = other.fit, _compare(first, first.fit, other, other.fit)
    if compared is None:
        return other
    away = np.append(own.D - compared.D, own.b_a - compared.b_a)
    spread = (own.covariance + compared.covariance)[ACCELEROMETER, ACCELEROMETER]
    known = (beside := replace(other, fit=compared, claim=None)).uncertainty
    if known is None or away @ np.linalg.solve(spread, away) > most_chi2(len(away)):
        return other
    return replace(beside, claim=UncertaintyClaim(compared.covariance, known.rms_mps2, known.rms_mps2))


def _is_plain(evidence: Evidence) -> bool:
    """Return True for an estimate by a good gyroscope, in which the sensor did not change."""
    unchanged = evidence.changed is None and (evidence.claim is None or evidence.claim.change is None)
    return unchanged and evidence.model in MODELS and evidence.gyro_fault is None and evidence.uncertainty is not None


def _compare(first: Evidence, by: Fit, other: Evidence, own: Fit) -> Fit | None:
    """Return the fit of the other accelerometer by the first one's; None where they have too few samples in common."""
    there, here = first.recording, other.recording
    after = np.clip(np.searchsorted(there.t, here.t), 1, len(there) - 1)
    near = (there.t[after] - there.t[after - 1] < APART_S) & (here.t >= there.t[0]) & (here.t <= there.t[-1])
    if first.flat is None or near.sum() < FEWEST:
        return None
    inverse = np.linalg.inv(by.D)
    felt = (there.acc - by.b_a) @ inverse.T
    measured = smoothed_rates(there, replace(first.flat, last=0, b_omega=by.b_omega))
    rate, alpha = (values @ by.K.T for values in measured)
    columns = np.hstack([felt, np.gradient(felt, there.t, axis=0), rate, alpha, there.gyr])
    t = here.t[near]
    s, change, rate, alpha, rates = np.hsplit(np.stack([np.interp(t, there.t, c) for c in columns.T], axis=1), 5)
    L = cross(alpha) + cross(rate) @ cross(rate)
    more = own.D @ np.concatenate([L, -change[:, :, None]], axis=2)
    n = max(round(STAYS_S * here.rate_hz), 4)
    theta, covariance = _solve([_axis(axis, t, here.acc[near], s, more, here.sensor.steps[0], n) for axis in range(3)])
    D = theta[:9].reshape(3, 3)
    # The errors of the first one's D and b_a are errors of s.
    by_first = _of_D_and_b_a(np.kron(D @ inverse, np.eye(3)), D @ inverse)
    covariance += by_first @ by.covariance[ACCELEROMETER, ACCELEROMETER] @ by_first.T
    # D is in the axes in which its own gyroscope's K is symmetric: Q turns those of the first one into them.
    later = np.concatenate([np.zeros((len(t), 3, 3)), -alpha[:, :, None]], axis=2)
    M, of_M = _solve([_axis(axis, t, here.gyr[near], rates, later, here.sensor.steps[1], n) for axis in range(3)])
    Q = nearest_rotation(own.K @ M[:9].reshape(3, 3) @ np.linalg.inv(by.K))
    D = D @ Q.T
    in_own_axes = _of_D_and_b_a(np.kron(np.eye(3), Q), np.eye(3))
    by_M = (0.5 * cross(np.eye(3)) @ Q).reshape(3, 9)  # of the small turn that an error of M is for Q
    by_Q = -(D @ cross(np.eye(3))).reshape(3, 9).T @ by_M
    whole = own.covariance.copy()
    whole[ACCELEROMETER], whole[:, ACCELEROMETER] = 0.0, 0.0
    whole[ACCELEROMETER, ACCELEROMETER] = in_own_axes @ covariance @ in_own_axes.T
    whole[PLACES["D"], PLACES["D"]] += by_Q @ of_M[:9, :9] @ by_Q.T
    return replace(own, D=D, b_a=theta[9:12], covariance=whole)


def _of_D_and_b_a(of_D: NDArray[np.floating[Any]], of_b_a: NDArray[np.floating[Any]]) -> Vector:  # noqa: N802 - the paper's letter
    """Return the matrix (12, 12) that maps D, row-major, by `of_D` (9, 9) and b_a by `of_b_a` (3, 3)."""
    whole = np.zeros((12, 12))
    whole[:9, :9], whole[9:, 9:] = of_D, of_b_a
    return whole


class _Measurements(NamedTuple):
    """Measurements y (m,) = A (m, 16) @ theta, at times t (m,); jitter (m,) is the square of ds/dt, as times err."""

    A: Vector
    y: Vector
    t: Vector
    jitter: Vector


def _axis(axis: int, t: Vector, y: Vector, s: Vector, more: Vector, step: float, n: int) -> _Measurements:
    """Return the measurements of an axis: means over readings that stay on two steps, whose rounding is common.

    more : (m, 3, 4) derivatives by r and tau. n : see _groups.
    """
    starts = _groups(y[:, axis], step, n)
    size = np.diff(np.append(starts, len(y)))
    columns = np.column_stack([s, more[:, axis], y[:, axis], t, more[:, axis, 3] ** 2])
    means = np.add.reduceat(columns, starts, axis=0) / size[:, None]
    A = np.zeros((len(starts), 16))
    A[:, 3 * axis : 3 * axis + 3], A[:, 9 + axis], A[:, 12:] = means[:, :3], 1.0, means[:, 3:7]
    return _Measurements(A, *means[:, 7:].T)


def _groups(values: Vector, step: float, n: int) -> NDArray[np.int64]:
    """Return the first samples of the groups: neighbouring windows of n readings on two steps, or single readings."""
    starts = np.ones(len(values), bool)
    windows = values[: len(values) // n * n].reshape(-1, n)
    stuck, mean = windows.var(axis=1) < UNVARIED * step**2, windows.mean(axis=1)
    first = starts[: windows.size].reshape(-1, n)
    first[stuck, 1:] = False
    first[1:, 0] &= ~(stuck[1:] & stuck[:-1] & (np.abs(np.diff(mean)) < step))
    return np.flatnonzero(starts)


def _solve(axes: Sequence[_Measurements]) -> tuple[Vector, Vector]:
    """Return theta (16,) of (19), D row-major, b_a, r and tau, and the covariance (12, 12) of the first twelve.

    The variance of a measurement is that of rounding and noise, and by jitter; both are estimated from the residuals.
    """
    A, y, t, jitter = map(np.concatenate, zip(*axes, strict=True))
    prior = np.diag(np.concatenate([np.zeros(12), 1.0 / np.square([*BY_NAME["r"].sd, *BY_NAME["tau"].sd])]))
    kinds = np.column_stack([np.ones_like(y), jitter])
    variance, weight = np.ones_like(y), np.ones_like(y)
    for _ in range(REWEIGHTED):
        W = (weight / variance)[:, None]
        H = A.T @ (W * A) + prior
        theta = np.linalg.solve(H, A.T @ (W[:, 0] * y))
        e = y - A @ theta
        V = (weight / variance**2)[:, None] * kinds
        variance = kinds @ np.maximum(np.linalg.solve(kinds.T @ V, V.T @ e**2), (QUIETEST_ACC_MPS2**2, 0.0))
        weight = np.minimum(1.0, HUBER**2 / np.maximum(e**2 / variance, HUBER**2))  # as in (14)
    # Neighbours' errors have common causes: their gradients add up before they are squared.
    _, together = np.unique(t // COMMON_S, return_inverse=True)
    gradients = np.zeros((together.max() + 1, 16))
    np.add.at(gradients, together, W * A * e[:, None])
    root = np.linalg.solve(H, gradients.T)[ACCELEROMETER]
    return theta, root @ root.T
