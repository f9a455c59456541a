"""Columns without names, by physics: which three hold gravity, and which three turn it as it turns.

The first three adjacent columns that keep a magnitude are the accelerometer; the three whose rates turn this vector as
it turns are the gyroscope; the time is a column that increases and by which they turn it at the speed of one of their
units. Nothing is guessed that physics does not confirm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector
from ..hints import ROLES, Hints
from .clock import FEWEST, sample_period
from .units import (
    ANY_HZ,
    BEYOND,
    EXPLAINED,
    FASTEST_HZ,
    FEWEST_PER_G,
    MOST_PER_G,
    QUANTITIES,
    acceleration_unit,
    are_counts,
    gyro_unit,
    time_unit,
    to_signed,
    turning,
    typical_size,
)

WIDEST = 16
# relative error of |a| at rest that is still nearly 1 g: the scale factors and biases of usual sensors
ONE_G = 0.04
# largest distance of the quartiles of |a|, over its median: gravity, with the biases of an uncalibrated sensor
MOST_SCATTER = 0.75
# correlation of a clock with the number of its samples, even if a logger paused for a tenth of the time
EVEN = 0.99
# a correlation that is less by as much is no worse
ALIKE = 0.1


def guess_columns(table: Vector, hints: Hints) -> dict[str, int]:
    """Return role -> place among the columns of (n, k) numbers; empty if nothing fits."""
    table = table[np.isfinite(table).all(axis=1)]
    if len(table) >= FEWEST:
        varies = np.flatnonzero(np.ptp(table, axis=0) > 0.0)
        if len(varies) < table.shape[1]:
            return {role: int(varies[at]) for role, at in guess_columns(table[:, varies], hints).items()}
    n, width = table.shape
    if n < FEWEST or not 6 <= width <= WIDEST or not (np.abs(table) < BEYOND**2).all():
        return {}
    clocks = [place for place in range(width) if is_clock(table[:, place]) and not is_index(table[:, place])]
    for at in (*clocks, None):
        t = _seconds(None if at is None else table[:, at], n, hints)
        pairs = _pairs(table, [place for place in range(width) if place != at])
        turned = {pair: _turned(table, pair, t, any_rate=at is None) for pair in pairs}
        # rates turn a magnetic field, too
        for sized in (True, False):
            alike = [pair for pair in pairs if turned[pair] >= EXPLAINED and _has_size(table, pair) is sized]
            best = max((turned[pair] for pair in alike), default=0.0)
            found = next((pair for pair in alike if turned[pair] >= best - ALIKE), None)
            if found is not None:
                return dict(zip(ROLES[1:], found, strict=True)) | ({} if at is None else {"t": at})
    return _accelerometer_alone(table, clocks)


def _accelerometer_alone(table: Vector, clocks: list[int]) -> dict[str, int]:
    """Return the only triple of columns as long as gravity, and the time; for a board that hardly turned."""
    places = [place for place in range(table.shape[1]) if place not in clocks[:1]]
    triples = [places[first : first + 3] for first in range(0, len(places) - 2, 3)]
    found = [triple for triple in triples if _is_one_g(table[:, triple])]
    if len(found) != 1:
        return {}
    return dict(zip(ROLES[1:4], found[0], strict=True)) | dict(zip("t", clocks, strict=False))


def _is_one_g(acc: Vector) -> bool:
    """Return True if (n, 3) numbers are nearly 1 g long in m/s^2, g or counts, and vary."""
    size, scatter = typical_size(acc)
    units = [QUANTITIES["acc"]["m/s^2"] / STANDARD_GRAVITY_MPS2, 1.0]
    if size > 0.0 and are_counts(acc):
        units = [2.0 ** -min(max(round(math.log2(size)), FEWEST_PER_G), MOST_PER_G)]
    return 0.0 < scatter < ONE_G * size and any(abs(size * si - 1.0) < ONE_G for si in units)


def _has_size(table: Vector, pair: Sequence[int]) -> bool:
    """Return True if the first three columns are as large as gravity in some unit, or counts."""
    acc = to_signed(table[:, list(pair[:3])])
    return are_counts(acc) or bool(acceleration_unit(acc))


def is_clock(column: Vector) -> bool:
    """Return True if (n,) numbers increase, and do not only repeat."""
    steps = np.diff(column[np.isfinite(column)])
    return len(steps) > 0 and bool((steps >= 0).all() and (steps > 0).mean() > 0.01)


def is_index(column: Vector) -> bool:
    """Return True if (n,) numbers count the samples, and so are no times in ms."""
    return bool((np.diff(column) == 1.0).all())


def is_even_clock(column: Vector) -> bool:
    """Return True if (n,) numbers increase with the samples, at a sensor's rate in some unit, and do not count them."""
    if not is_clock(column) or is_index(column):
        return False
    correlation = float(np.corrcoef(column, np.arange(len(column)))[0, 1])
    return correlation > EVEN and bool(time_unit(sample_period(column)))


def _seconds(clock: Vector | None, n: int, hints: Hints) -> Vector:
    if clock is None:
        return np.arange(n) / (hints.rate_hz or ANY_HZ)
    step = sample_period(clock)
    si = next((si for si in QUANTITIES["t"].values() if 1 / FASTEST_HZ <= step * si <= 1.0), 1.0 / ANY_HZ / step)
    return np.asarray((clock - clock[0]) * si)


def _pairs(table: Vector, places: list[int]) -> list[tuple[int, ...]]:
    """Return the places of two sensors' three adjacent columns each, of which the first keep a magnitude."""
    starts = range(len(places) - 2)
    sizes = {a: typical_size(to_signed(table[:, places[a : a + 3]])) for a in starts}
    gravity = [a for a, (size, scatter) in sizes.items() if 0.0 < scatter <= MOST_SCATTER * size]
    return [(*places[a : a + 3], *places[w : w + 3]) for a in gravity for w in starts if abs(a - w) >= 3]


def _turned(table: Vector, pair: Sequence[int], t: Vector, *, any_rate: bool) -> float:
    """Return how well the rates explain the turning of gravity, from 0 to 1; 0 if it is at no unit's speed."""
    acc, gyr = (to_signed(table[:, list(places)]) for places in (pair[:3], pair[3:]))
    factor, correlation = turning(t, acc, gyr)
    of_a_unit = any_rate or are_counts(gyr) or gyro_unit(factor)
    return correlation if factor > 0.0 and of_a_unit else 0.0
