"""Scores of the parts of a series at a minimum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
from .levenberg_marquardt import Minimum
from .likelihood import PartScores, evaluate, part_scores
from .parts import Parts
from .problem import Problem
from .theta import Prior, Theta

MOST_PARTS, FEWEST_SAMPLES = 96, 16


def ends_of(problem: Problem) -> NDArray[np.int64] | None:
    """Return (k,) where the parts of a problem end; None for a series too short to be cut."""
    n = len(problem.series)
    k = min(MOST_PARTS, n // FEWEST_SAMPLES)
    return np.arange(1, k + 1, dtype=np.int64) * n // k if k > 1 else None


def parts_of(problem: Problem, minimum: Minimum, prior: Prior) -> Parts | None:
    """Return the parts of a problem at its minimum; None for a series too short to be cut.

    A minimum that was found with sums up to the parts' ends needs no further pass of the filter.
    """
    theta, free, ends = minimum.theta, minimum.free, ends_of(problem)
    if ends is None:
        return None
    seen, at = minimum.seen
    to_ends = at.to_ends or evaluate(problem, seen, len(free), ends).to_ends
    assert to_ends is not None
    scores = part_scores(problem, seen, len(free), to_ends).moved(minimum.last)
    left = scores.gradient.sum(0) + scores.flat.gradient + prior.gradient(theta, len(free))
    H = scores.fisher.sum(0) + scores.flat.fisher + np.diag(prior.precision[: len(free)])
    seen_parts = PartScores(scores.gradient[:, free], scores.fisher[:, free][:, :, free], scores.flat)
    return with_times(problem, theta, seen_parts, H[np.ix_(free, free)], left[free])


def with_times(problem: Problem, theta: Theta, scores: PartScores, H: Vector, left: Vector) -> Parts:
    """Return the parts of a problem with their times and readings, see Parts."""
    series, ends = problem.series, ends_of(problem)
    assert ends is not None
    t = np.concatenate([[0.0], np.cumsum(series.dt)])
    starts = np.concatenate([[0], ends[:-1]]).astype(np.intp)  # 32 bits on some ARMs
    mean = np.add.reduceat(series.y, starts) / np.diff(ends, prepend=0)[:, None]
    reading = np.vstack([problem.flat.y, mean]) - theta.b_a
    return Parts(scores.gradient, scores.fisher, H, left, t[starts], t[ends], reading)
