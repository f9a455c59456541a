"""The hand's acceleration: kinds of noise, their most likely size, and the tremor with a lever arm of its own."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np

from ..data import Vector
from ..rests.limits import VIBRATING_MPS2
from ..rests.tremor import low_pass
from ..rests.windows import WINDOW_S
from .levenberg_marquardt import Minimum
from .likelihood import trace, value
from .preprocessing import CORRELATION_S, FLOOR_MPS2, Preprocessed
from .problem import Problem
from .rotation import lengths
from .theta import Theta
from .transitions import REWEIGHTED
from .uncertainty import MOST_NIS

FEW_PEAKS_NIS = 1.5  # mean squared innovation of a vibration whose peaks are no outliers; that of white noise is 3
WHITE_MPS2 = (0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
VIBRATION_MPS2 = (*WHITE_MPS2, 4.0, 8.0, 16.0)
FIRST_MPS2 = WHITE_MPS2[4]  # sigma at which a search begins: a board that goes from rest to rest is in a hand
HAND_MPS2 = tuple(sigma for sigma in WHITE_MPS2 if sigma >= FIRST_MPS2)
CALM_MPS2 = WHITE_MPS2[3:]  # the same over all samples: less noise than a calm hand's is taken for jerks
PIVOT_MPS2 = (0.1, 0.18, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)

# A pivot travels farther than a bounded position of one lambda. The covariance admits that it comes back more slowly
# [1/s], since a sway as slow as the turns looks like gravity.
FARTHER, SLOWLY_PER_S = 1.8, 2.5


@dataclass(frozen=True)
class Noise:
    """Noise of the hand's acceleration while it moves: none, white (correlated), or a pivot's, of sigma m/s^2.

    lam : 1/s, how fast a pivot comes back, where it differs from the estimate's.
    """

    kind: Literal["none", "white", "pivot"]
    sigma: float
    lam: float | None = None

    def problem(self, prepared: Preprocessed) -> Problem:
        """Return the problem with this noise."""
        if self.kind == "pivot":
            return prepared.pivot(self.sigma, FLOOR_MPS2, self.lam)
        return prepared.white(self.sigma, CORRELATION_S if self.kind == "white" else 0.0)


def most_likely_sigma(
    problem_of: Callable[[float], Problem], sigmas: tuple[float, ...], theta: Theta, begin: float
) -> float:
    """Return the sigma of least V at theta: V has one minimum, and the grid is followed from `begin` while V falls."""

    def cost(at: int) -> float:
        return value(problem_of(sigmas[at]), theta) if 0 <= at < len(sigmas) else math.inf

    at = first = sigmas.index(begin)
    least = cost(at)
    for step in (-1, 1):  # downwards first, since all samples show less noise than block means do
        while (there := cost(at + step)) < least:
            at, least = at + step, there
        if at != first:
            break
    return sigmas[at]


def vibration_sigma(prepared: Preprocessed, noise: Noise, minimum: Minimum) -> float:
    """Return the least sigma [m/s^2] of a vibration that explains the innovations at a minimum; 0 if none does.

    It shows in the noise around each sample; or, if it is slow, in the innovations: jerks make some of them large, a
    change of the sensor all of half a second, and a vibration most, with either sign. A vibration is skewed, and has no
    tails: with its true size, the loss would take peaks for outliers, and the estimate follow those of one side.
    """
    n = max(round(WINDOW_S * prepared.recording.rate_hz), 2)

    @cache
    def squares(sigma: float) -> Vector:
        innovation = trace(noise.problem(prepared.vibrating(sigma)), minimum.theta).innovation
        windows = innovation[: len(innovation) // n * n].reshape(-1, n, 3)
        return np.asarray(np.sum((windows - np.median(windows, axis=1, keepdims=True)) ** 2, axis=2))

    scale = prepared.problem.series.r_scale
    if prepared.rests_often or scale is None:
        return 0.0
    is_loud = np.mean(scale * prepared.flat.Sigma_a.mean() > VIBRATING_MPS2**2) > 0.5
    if not (is_loud or (minimum.nis > MOST_NIS and np.median(squares(0.0)) > MOST_NIS)):
        return 0.0
    return next((sigma for sigma in VIBRATION_MPS2 if squares(sigma).mean() < FEW_PEAKS_NIS), 0.0)


def remove_tremor(prepared: Preprocessed) -> Preprocessed:
    """Remove the acceleration of the tremor, and keep the angular acceleration of the turns alone.

    A hand trembles about another joint than the one about which it turns the board. The tremor's own lever arm r_t is
    the least squares solution of y = alpha x r_t above the turns' frequencies, where alpha is known: in motion.
    """
    series, rate_hz = prepared.problem.series, prepared.recording.rate_hz
    if series.alpha is None or not series.alpha.any():
        return prepared
    turns = low_pass(series.alpha, rate_hz)
    alpha, y = series.alpha - turns, series.y - low_pass(series.y, rate_hz)
    moving = np.any(series.alpha != 0.0, axis=1) / (1.0 if series.r_scale is None else series.r_scale)
    weight = moving
    for _ in range(REWEIGHTED):
        weighted = weight[:, None] * alpha
        N = np.eye(3) * np.sum(weighted * alpha) - alpha.T @ weighted
        r_t = np.linalg.pinv(N) @ np.sum(np.cross(y, weighted), axis=0)
        away = lengths(y - np.cross(alpha, r_t))
        # Cauchy's weights leave out jerks, which are no tremor.
        weight = moving / (1.0 + (away / (2.0 * np.median(away[moving > 0.0]) + 1e-9)) ** 2)
    series = replace(series, y=series.y - np.cross(alpha, r_t), alpha=turns)
    return replace(prepared, problem=replace(prepared.problem, series=series))
