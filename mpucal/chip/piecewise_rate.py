"""Where a straight line broke: least squares in pieces, for a sample clock whose rate changed.

Binary segmentation: of all places, the one at which two lines explain the points best is a break where they do so
beyond chance; then the same on either side of it. `pieces.cpp` looks at all places.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..data import Vector
from ._pieces import best_break

# A break must explain this many times the variance that is left. Chance alone, over all places, stays below 30.
BREAK = 100.0
# The variance of a look that falls anywhere between two samples; less is never left.
LEAST_VARIANCE = 1 / 12
# Two slopes differ where they do by so many standard deviations.
DIFFERENT = 8.0
# Points on either side of a break, and time [s].
LEAST_POINTS, LEAST_S = 20, 2.0


@dataclass(frozen=True)
class Line:
    """One piece: `first` is the y with which it begins.

    `t_s`, `y` : means of its points. `spread_s2`, `product_s` : sums of (t - mean)^2 and (t - mean)(y - mean).
    `variance` : of a point about it.
    """

    first: float
    t_s: float
    y: float
    spread_s2: float
    product_s: float
    variance: float


def fit_lines(t_s: Vector, y: Vector) -> list[Line]:
    """The pieces that explain the points, in order."""
    edges = [0, *find_breaks(t_s, y), len(t_s)]
    found = []
    for begin, end in pairwise(edges):
        first = (y[begin - 1] + y[begin]) / 2 if begin else 0.0
        found.append(_line(float(first), t_s[begin:end], y[begin:end]))
    return found


def merge_equal_slopes(pieces: list[Line], nominal: float, tolerance: float) -> Vector:
    """(n,) the slope of each piece; those in a row that do not differ beyond chance share one.

    The prior of a slope is `nominal`, within `tolerance` of itself.
    """
    prior_s2 = LEAST_VARIANCE / (tolerance * nominal) ** 2
    groups: list[list[Line]] = []
    for piece in pieces:
        if groups and _agree(groups[-1], piece):
            groups[-1].append(piece)
        else:
            groups.append([piece])
    slopes = []
    for group in groups:
        product, spread = sum(p.product_s for p in group), sum(p.spread_s2 for p in group)
        slopes += [(product + prior_s2 * nominal) / (spread + prior_s2)] * len(group)
    return np.array(slopes)


def _agree(group: list[Line], piece: Line) -> bool:
    spread, product = sum(p.spread_s2 for p in group), sum(p.product_s for p in group)
    if not (spread and piece.spread_s2):
        return True
    variance = max(piece.variance, *(p.variance for p in group))
    std = float(np.sqrt(variance * (1 / spread + 1 / piece.spread_s2)))
    return abs(product / spread - piece.product_s / piece.spread_s2) < DIFFERENT * std


def _line(first: float, t_s: Vector, y: Vector) -> Line:
    t_mean, y_mean = float(t_s.mean()), float(y.mean())
    t, y = t_s - t_mean, y - y_mean
    spread, product = float(t @ t), float(t @ y)
    left_over = float(y @ y) - (product * product / spread if spread else 0.0)
    return Line(first, t_mean, y_mean, spread, product, max(left_over / max(len(t) - 2, 1), LEAST_VARIANCE))


def find_breaks(t_s: Vector, y: Vector) -> list[int]:
    """The points, in order, with which a new line begins; `t_s` (n,) increases, y (n,)."""
    found: list[int] = []
    todo = [(0, len(t_s))]
    while todo:
        first, last = todo.pop()
        at = _find_break(t_s[first:last], y[first:last])
        if at is not None:
            found.append(first + at)
            todo += [(first, first + at), (first + at, last)]
    return _recheck_breaks(t_s, y, sorted(found))


def _recheck_breaks(t_s: Vector, y: Vector, found: list[int]) -> list[int]:
    """Each break anew between its neighbours: one that was found before they were may be off, or none."""
    kept: list[int] = []
    for following in [*found[1:], len(t_s)]:
        first = kept[-1] if kept else 0
        at = _find_break(t_s[first:following], y[first:following])
        if at is not None:
            kept.append(first + at)
    return kept if found else []


def _find_break(t_s: Vector, y: Vector) -> int | None:
    """Where two lines explain what one does not; None where one is enough."""
    n = len(t_s)
    if n < 2 * LEAST_POINTS or t_s[-1] - t_s[0] < 2 * LEAST_S:
        return None
    at, both, one = best_break(t_s - t_s.mean(), y - y.mean(), LEAST_POINTS, LEAST_S)
    if at < 0:
        return None
    variance = max(both / (n - 4), LEAST_VARIANCE)
    return at if one - both > BREAK * variance else None
