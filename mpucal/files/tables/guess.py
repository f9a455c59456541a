"""Columns without names, by physics: which three hold gravity, and which three turn it as it turns.

The first three adjacent columns that keep a magnitude are the accelerometer; the three whose rates turn this vector as
it turns are the gyroscope; a column before both that increases steadily is the time. Nothing is guessed that physics
does not confirm.
"""

from __future__ import annotations

import numpy as np

from ...data import Vector
from ..hints import ROLES, Hints
from .clock import sample_period
from .units import ANY_HZ, BEYOND, FASTEST_HZ, QUANTITIES, rate_factor, to_signed

FEWEST, WIDEST = 300, 16
# largest distance of the quartiles of |a|, over its median: gravity, with the biases of an uncalibrated sensor
MOST_SCATTER = 0.75
# more samples add nothing
MOST_SAMPLES = 200_000


def guess_columns(table: Vector, hints: Hints) -> tuple[dict[str, int], str]:
    """Return role -> place among the columns of (n, k) numbers, and a remark; both are empty if nothing fits."""
    n, width = table.shape
    table = table[:MOST_SAMPLES]
    if n < FEWEST or not 6 <= width <= WIDEST or not (np.abs(table) < BEYOND).all():
        return {}, ""
    for at in (0, 1):
        clock = table[:, 0] if at else None
        if clock is not None and not _is_clock(clock):
            continue
        found = _sensors(table, at, _seconds(clock, len(table), hints))
        if found:
            order = {role: place for role, place in zip(ROLES[1:], found, strict=True)} | ({"t": 0} if at else {})
            words = ["-"] * (max(order.values()) + 1)
            for role, place in order.items():
                words[place] = role
            return order, f"its columns were guessed from how gravity turns: --columns {','.join(words)}"
    return {}, ""


def _is_clock(column: Vector) -> bool:
    steps = np.diff(column)
    return bool((steps >= 0).all() and column[-1] > column[0] and (steps > 0).mean() > 0.01)


def _seconds(clock: Vector | None, n: int, hints: Hints) -> Vector:
    if clock is None:
        return np.arange(n) / (hints.rate_hz or ANY_HZ)
    step = sample_period(clock)
    si = next((si for si in QUANTITIES["t"].values() if 1 / FASTEST_HZ <= step * si <= 1.0), 1.0 / ANY_HZ / step)
    return np.asarray((clock - clock[0]) * si)


def _sensors(table: Vector, first: int, t: Vector) -> list[int]:
    """Return the places of ax, ay, az, gx, gy, gz; empty if no columns fit."""
    triples = range(first, table.shape[1] - 2, 3)
    for a in triples:
        acc = to_signed(table[:, a : a + 3])
        low, size, high = np.percentile(np.linalg.norm(acc, axis=1), [25, 50, 75]).tolist()
        if not 0.0 < high - low <= MOST_SCATTER * size:
            continue
        for w in triples:
            if w != a and (rate_factor(t, acc, to_signed(table[:, w : w + 3])) or 0.0) > 0.0:
                return [a, a + 1, a + 2, w, w + 1, w + 2]
    return []
