"""Piecewise linear regression for a sample clock whose rate changed.

Binary segmentation: the place at which two lines explain the points best is a break if they do so beyond chance; then
the points on either side of it are searched in the same way.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..arguments import Vector
from . import UNIFORM

# A break must explain this many times the residual variance. Chance alone, over all places, stays below 30.
LEAST_BREAK_RATIO = 100.0
# Two slopes are different if they differ by this many standard deviations.
DIFFERENT_SLOPE_STDS = 8.0
# Points on either side of a break, and time [s].
LEAST_POINTS, LEAST_S = 20, 2.0


class Line(NamedTuple):
    """Line of one piece.

    Attributes
    ----------
    first : the y with which it begins. t_s, y : means of its points.
    spread_s2, product_s : sums of (t - mean)^2 and (t - mean)(y - mean). variance : of a point about the line.
    """

    first: float
    t_s: float
    y: float
    spread_s2: float
    product_s: float
    variance: float


def fit_lines(t_s: Vector, y: Vector) -> list[Line]:
    """Fit a line to each piece of the points, in order."""
    lines = []
    for begin, end in pairwise([0, *find_breaks(t_s, y), len(t_s)]):
        first = float((y[begin - 1] + y[begin]) / 2) if begin else 0.0
        t_mean, y_mean = float(t_s[begin:end].mean()), float(y[begin:end].mean())
        dt, dy = t_s[begin:end] - t_mean, y[begin:end] - y_mean
        spread, product = float(dt @ dt), float(dt @ dy)
        residual = float(dy @ dy) - (product * product / spread if spread else 0.0)
        variance = max(residual / max(len(dt) - 2, 1), UNIFORM)
        lines.append(Line(first, t_mean, y_mean, spread, product, variance))
    return lines


def merge_equal_slopes(pieces: list[Line], nominal: float, tolerance: float) -> Vector:
    """Return the slope of each piece (n,); consecutive pieces that do not differ beyond chance share one.

    The prior of a slope is `nominal`, within `tolerance` of itself.
    """
    prior_s2 = UNIFORM / (tolerance * nominal) ** 2
    groups: list[list[Line]] = []
    for piece in pieces:
        if groups and _have_equal_slopes(groups[-1], piece):
            groups[-1].append(piece)
        else:
            groups.append([piece])
    slopes = []
    for group in groups:
        product, spread = sum(p.product_s for p in group), sum(p.spread_s2 for p in group)
        slopes += [(product + prior_s2 * nominal) / (spread + prior_s2)] * len(group)
    return np.array(slopes)


def _have_equal_slopes(group: list[Line], piece: Line) -> bool:
    spread, product = sum(p.spread_s2 for p in group), sum(p.product_s for p in group)
    if not (spread and piece.spread_s2):
        return True
    variance = max(piece.variance, *(p.variance for p in group))
    std = float(np.sqrt(variance * (1 / spread + 1 / piece.spread_s2)))
    return abs(product / spread - piece.product_s / piece.spread_s2) < DIFFERENT_SLOPE_STDS * std


def find_breaks(t_s: Vector, y: Vector) -> list[int]:
    """Return the points, in order, at which a new line begins; `t_s` (n,) increases, y (n,)."""
    found: list[int] = []
    todo = [(0, len(t_s))]
    while todo:
        first, last = todo.pop()
        at = _find_break(t_s[first:last], y[first:last])
        if at is not None:
            found.append(first + at)
            todo += [(first, first + at), (first + at, last)]
    # Search each break again between its neighbours: found before them, it may be off, or none.
    found.sort()
    kept: list[int] = []
    for following in [*found[1:], len(t_s)] if found else []:
        first = kept[-1] if kept else 0
        at = _find_break(t_s[first:following], y[first:following])
        if at is not None:
            kept.append(first + at)
    return kept


def _find_break(t_s: Vector, y: Vector) -> int | None:
    """Return the first point of the second of two lines; None if one line explains the points."""
    n = len(t_s)
    if n < 2 * LEAST_POINTS or t_s[-1] - t_s[0] < 2 * LEAST_S:
        return None
    t, y = t_s - t_s.mean(), y - y.mean()
    before, after = _residual_squares(t, y), _residual_squares(t[::-1], y[::-1])[::-1]
    places = np.arange(LEAST_POINTS, n - LEAST_POINTS + 1)
    places = places[(t[places - 1] - t[0] >= LEAST_S) & (t[-1] - t[places] >= LEAST_S)]
    if not len(places):
        return None
    both = before[places - 1] + after[places]
    best = int(np.argmin(both))
    variance = max(both[best] / (n - 4), UNIFORM)
    return int(places[best]) if before[-1] - both[best] > LEAST_BREAK_RATIO * variance else None


def _residual_squares(t: Vector, y: Vector) -> Vector:
    """Return the sum of squares about the line through points 0..k, for every k (n,)."""
    k, st, sy = np.arange(1.0, len(t) + 1.0), np.cumsum(t), np.cumsum(y)
    stt, sty = np.cumsum(t * t) - st * st / k, np.cumsum(t * y) - st * sy / k
    explained = np.divide(sty * sty, stt, out=np.zeros(len(t)), where=stt > 0)
    return np.maximum(np.cumsum(y * y) - sy * sy / k - explained, 0.0)
