"""Slip of the mount between two rests: from then on, all transitions contradict the gyroscope in one way.

A miss between rests that the gyroscope's noise does not explain is taken for an error of the gyroscope, and the fit
becomes unsure of everything. A mount that slipped leaves a pattern: rotations delta of the accelerometer against the
gyroscope, one before and one after, explain all misses. They do where the likelihood says so, by the BIC.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..data import Vector
from .hypotheses import SURE
from .rotation import lengths
from .transitions import DEGREES_OF_FREEDOM, Transition, miss_variances

FEWEST_BESIDE = 3  # transitions before a slip and after it: with fewer, two of a lost gyroscope would look like one
ITERATIONS = 8


class Slip(NamedTuple):
    """Slip of the mount.

    span : (2,) s after the flat segment, between which it happened. delta : (3,) rad, rotation of the accelerometer.
    """

    span: tuple[float, float]
    delta: Vector


def find_slip(transitions: Sequence[Transition], dt: Vector) -> Slip | None:
    """Return the slip that explains the misses of transitions between rests, or None.

    dt : (n,) s, the steps of the series.
    """
    k = len(transitions)
    if k < 2 * FEWEST_BESIDE + 1:
        return None
    always = _likelihood(transitions, _directions(transitions, k)[:, :, :3])[0]
    cost = math.log(SURE) + 1.5 * math.log(2 * k) + math.log(k)  # of three numbers more, and of so many times
    places = range(FEWEST_BESIDE, k - FEWEST_BESIDE)
    found = {at: _likelihood(transitions, _directions(transitions, at)) for at in places}
    at = max(found, key=lambda at: found[at][0])
    likelihood, x = found[at]
    if not likelihood > always + cost:
        return None
    t, span = np.cumsum(dt), transitions[at].span
    return Slip((float(t[max(span.start - 1, 0)]), float(t[span.stop - 1])), x[3:] - x[:3])


def _directions(transitions: Sequence[Transition], at: int) -> Vector:
    """Return derivatives (k, 3, 6) of the misses by the rotation before a slip in transition `at`, and after it."""
    v = np.array([each.coming for each in transitions])
    v /= lengths(v)[:, None]
    P = np.eye(3) - v[:, :, None] * v[:, None, :]  # a rotation about gravity is no miss
    after_start, after_end = (np.arange(len(v)) > at)[:, None, None], (np.arange(len(v)) >= at)[:, None, None]
    PF = P @ [each.F for each in transitions]
    return np.concatenate([P * ~after_end - PF * ~after_start, P * after_end - PF * after_start], axis=2)


def _likelihood(transitions: Sequence[Transition], A: Vector) -> tuple[float, Vector]:
    """Return the log likelihood of the misses by Student's t, at the likeliest x of misses + A x, and this x."""
    miss, x = np.array([each.miss for each in transitions]), np.zeros(A.shape[2])
    known = np.array([each.variance for each in transitions])
    for _ in range(ITERATIONS):
        left = [each._replace(miss=m) for each, m in zip(transitions, miss + A @ x, strict=True)]
        variance = miss_variances(left)
        weighted = A / variance[:, None, None]
        x = -np.linalg.lstsq(np.einsum("kij,kil->jl", weighted, A), np.einsum("kij,ki->j", weighted, miss))[0]
    c = float(np.min(variance / known))
    z, nu = 0.5 * np.sum((miss + A @ x) ** 2, axis=1) / known, DEGREES_OF_FREEDOM
    return -float(np.sum(math.log(c) + 0.5 * (nu + 2.0) * np.log1p(2.0 * z / (c * nu)))), x
