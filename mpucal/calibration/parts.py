"""Parts of a series, with their scores at the estimate.

Where the model holds, the parts differ by chance. Where it does not (drift, a nonlinear sensor, vibration), only the
parts show it, and not the covariance of the estimate: see hypotheses.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
from .levenberg_marquardt import Minimum, inverse
from .likelihood import evaluate, part_scores
from .problem import Problem
from .theta import Prior

MOST_PARTS, FEWEST_SAMPLES = 96, 16


@dataclass(frozen=True)
class Parts:
    """Scores of k parts of about equal length, at the estimate.

    Attributes
    ----------
    gradient : (k, p) and fisher : (k, p, p), the share of each part in those of V, by the estimated parameters.
    H : (p, p) Fisher matrix of all parts, the prior and the flat mean. left : (p,) gradient of them, which a minimiser
        leaves at nearly 0.
    start, end : (k,) s after the flat segment. side : (k,) 0 to 5, the body's axis nearest to gravity, with its sign.
    """

    gradient: Vector
    fisher: Vector
    H: Vector
    left: Vector
    start: Vector
    end: Vector
    side: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.side)

    @cached_property
    def covariance(self) -> Vector:
        """Covariance (p, p) of the estimate, by the model."""
        return inverse(self.H)

    def grouped(self, groups: NDArray[np.intp]) -> tuple[Vector, Vector]:
        """Return gradients (m, p) and Fisher matrices (m, p, p) of groups; `groups` (k,) is the group of each part."""
        of = np.equal.outer(np.unique(groups), groups).astype(np.float64)
        return of @ self.gradient, np.tensordot(of, self.fisher, 1)

    def by_time(self, groups: int) -> NDArray[np.intp]:
        """Return (k,) the group of each part, in `groups` stretches of time."""
        return np.arange(len(self)) * groups // len(self)


def ends_of(problem: Problem) -> NDArray[np.int64] | None:
    """Return (k,) where the parts of a problem end; None for a series too short to be cut."""
    n = len(problem.series)
    k = min(MOST_PARTS, n // FEWEST_SAMPLES)
    return np.arange(1, k + 1, dtype=np.int64) * n // k if k > 1 else None


def parts_of(problem: Problem, minimum: Minimum, prior: Prior) -> Parts | None:
    """Return the parts of a problem at its minimum; None for a series too short to be cut.

    A minimum that was found with sums up to the parts' ends needs no further pass of the filter.
    """
    series, theta, free, ends = problem.series, minimum.theta, minimum.free, ends_of(problem)
    if ends is None:
        return None
    seen, at = minimum.seen
    to_ends = at.to_ends or evaluate(problem, seen, len(free), ends).to_ends
    assert to_ends is not None
    scores, k = part_scores(problem, seen, len(free), to_ends).moved(minimum.last), len(ends)
    t = np.concatenate([[0.0], np.cumsum(series.dt)])
    starts = np.concatenate([[0], ends[:-1]]).astype(np.intp)  # 32 bits on some ARMs
    mean = np.add.reduceat(series.y, starts) / np.diff(ends, prepend=0)[:, None]
    s = (mean - theta.b_a) @ theta.inverse.T
    axis = np.abs(s).argmax(1)
    away, precision = theta.values()[: len(free)] - prior.mean[: len(free)], prior.precision[: len(free)]
    left = scores.gradient.sum(0) + scores.flat.gradient + precision * away
    H = scores.fisher.sum(0) + scores.flat.fisher + np.diag(precision)
    return Parts(
        scores.gradient[:, free],
        scores.fisher[:, free][:, :, free],
        H[np.ix_(free, free)],
        left[free],
        t[starts],
        t[ends],
        2 * axis + (s[np.arange(k), axis] > 0.0),
    )
