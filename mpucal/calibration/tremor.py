"""A tremor's lever arm: a hand trembles about another joint than the one about which it turns the board."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Vector
from ..kernel import _kernel
from .preprocessing import Preprocessed
from .rotation import lengths

# Moving means over 2 TURNS_S, TIMES of them, keep turns below 2 Hz and nothing of a tremor of 8 to 12 Hz.
TURNS_S, TIMES = 0.04, 3
REWEIGHTED = 4  # least squares, each weighed by what the one before left


def remove_tremor(prepared: Preprocessed) -> Preprocessed:
    """The recording less the acceleration of its tremor, with the angular acceleration of the turns alone.

    The tremor's own lever arm r_t is the least squares solution of y = alpha x r_t above the turns' frequencies, where
    alpha is known: while the board moves.
    """
    series, rate_hz = prepared.problem.series, prepared.recording.rate_hz
    if series.alpha is None or not series.alpha.any():
        return prepared
    turns, slow = _of_turns(series.alpha, rate_hz), _of_turns(series.y, rate_hz)
    alpha, y = series.alpha - turns, series.y - slow
    moving = np.any(series.alpha != 0.0, axis=1) / (1.0 if series.r_scale is None else series.r_scale)
    weight = moving
    for _ in range(REWEIGHTED):
        weighted = weight[:, None] * alpha
        N = np.eye(3) * np.sum(weighted * alpha) - alpha.T @ weighted
        r_t = np.linalg.pinv(N) @ np.sum(np.cross(y, weighted), axis=0)
        away = lengths(y - np.cross(alpha, r_t))
        # jerks are none of it: Cauchy's weights
        weight = moving / (1.0 + (away / (2.0 * np.median(away[moving > 0.0]) + 1e-9)) ** 2)
    series = replace(series, y=series.y - np.cross(alpha, r_t), alpha=turns)
    return replace(prepared, problem=replace(prepared.problem, series=series))


def _of_turns(values: Vector, rate_hz: float) -> Vector:
    """The part of values (n, 3) that a hand's turns make."""
    for _ in range(TIMES):
        values = _kernel.moving_mean(values, int(TURNS_S * rate_hz))
    return values
