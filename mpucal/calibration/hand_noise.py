"""The hand's acceleration as noise: its kinds, the grids of sigma, and the likeliest of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from .likelihood import value
from .preprocessing import CORRELATION_S, FLOOR_MPS2, Preprocessed
from .problem import Problem
from .theta import Theta

FIRST_MPS2 = 0.3  # by which a search begins
WHITE_MPS2 = (0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
SOME_MPS2 = WHITE_MPS2[1:]
HAND_MPS2 = WHITE_MPS2[4:]  # who goes from rest to rest, has a hand
CALM_MPS2 = WHITE_MPS2[3:]  # and, over all samples, a calm one at least: what looks calmer is taken for jerks
PIVOT_MPS2 = (0.1, 0.18, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)

# A pivot travels farther than a bounded position of one lambda, the more the wilder it is: sigma (1.5 + 0.5 sigma). Its
# covariance admits that it comes back more slowly, 1/s: what sways as slowly as gravity turns is not told from it.
FARTHER, FARTHER_STILL, SLOWLY_PER_S = 1.5, 0.5, 2.0


@dataclass(frozen=True)
class Noise:
    """The hand's acceleration while it moves: none, white (correlated), or a pivot's, of sigma m/s^2.

    lam : 1/s, how fast a pivot comes back, where it is not as the estimate has it.
    """

    kind: Literal["none", "white", "pivot"]
    sigma: float
    lam: float | None = None

    def problem(self, prepared: Preprocessed) -> Problem:
        """What the filter runs over with this noise."""
        if self.kind == "pivot":
            return prepared.pivot(self.sigma, FLOOR_MPS2, self.lam)
        return prepared.white(self.sigma, CORRELATION_S if self.kind == "white" else 0.0)


def likeliest(problem_of: Callable[[float], Problem], sigmas: tuple[float, ...], theta: Theta, begin: float) -> float:
    """The sigma of least V at theta: along the grid from `begin` as far as V falls, which has one minimum."""

    def cost(at: int) -> float:
        return value(problem_of(sigmas[at]), theta) if 0 <= at < len(sigmas) else math.inf

    at = first = sigmas.index(begin)
    least = cost(at)
    for step in (-1, 1):  # all samples show less of it than means do
        while (there := cost(at + step)) < least:
            at, least = at + step, there
        if at != first:
            break
    return sigmas[at]


def farther(sigma: float) -> float:
    """The sigma of a pivot, whose likeliest bounded position has this one."""
    return (FARTHER + FARTHER_STILL * sigma) * sigma
