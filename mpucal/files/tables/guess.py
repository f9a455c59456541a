"""Columns without names, by physics: which three hold gravity, and which three turn it as it turns.

The first three adjacent columns that keep a magnitude are the accelerometer; the three whose rates turn this vector as
it turns are the gyroscope; the time is a column that increases and by which they turn it at the speed of one of their
units. Nothing is guessed that physics does not confirm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from ...clocks.stamps import FEWEST, sample_period
from ...data import ACCEL_COUNTS, STANDARD_GRAVITY_MPS2, Vector
from ..hints import NO_HINTS, ROLES, Hints
from . import shown_units as units
from .table import are_many
from .units import OF_INCREMENTS, QUANTITIES

# place -> (n,)
Columns = Mapping[int, Vector]
Places = tuple[int, ...]
MOST_COLUMNS = 16
# relative error of |a| at rest that is still nearly 1 g: the scale factors and biases of usual sensors
ONE_G = 0.04
# largest distance of the quartiles of |a|, over its median: gravity, with the biases of an uncalibrated sensor
MOST_SCATTER = 0.75
# the directions of gravity spread this many times as much as those of rates with a large bias
SPREAD_RATIO = 4.0
# correlation of a clock with the number of its samples, even if a logger paused for a tenth of the time
LEAST_CORRELATION = 0.99
# a correlation that is lower by no more than this counts as equally good
CORRELATION_MARGIN = 0.1


def guess_columns(of: Columns, hints: Hints) -> dict[str, int]:
    """Return role -> place among columns of numbers, which physics confirms; empty if nothing fits."""
    n = len(next(iter(of.values()), ()))
    of = {place: column for place, column in of.items() if n < FEWEST or np.ptp(column) > 0.0}
    if n < FEWEST or not 6 <= len(of) <= MOST_COLUMNS:
        return {}
    clocks = [place for place, column in of.items() if is_clock(column) and not is_index(column)]
    for at in (*clocks, None):
        t = _seconds(None if at is None else of[at], n, hints)
        pairs = _pairs(of, [place for place in of if place != at])
        turned = {pair: _turned(of, pair, t, any_rate=at is None) for pair in pairs}
        # rates turn a magnetic field, too, which in gauss is about half as long as gravity in g
        for size in (_is_in_si, _is_about_one_g, _has_size, len):
            alike = [pair for pair in pairs if turned[pair] >= units.EXPLAINED and size(_stacked(of, pair[:3]))]
            best = max((turned[pair] for pair in alike), default=0.0)
            found = next((pair for pair in alike if turned[pair] >= best - CORRELATION_MARGIN), None)
            if found is not None and not _has_rival(of, found):
                return dict(zip(ROLES[1:], found, strict=True)) | ({} if at is None else {"t": at})
    # a board that hardly turned: the only triple of columns as long as gravity
    found_alone = [
        triple
        for triple in _triples([place for place in of if place not in clocks[:1]])
        if _is_one_g(_stacked(of, triple))
    ]
    only = len(found_alone) == 1 and not _has_rival(of, found_alone[0])
    alone = dict(zip(ROLES[1:4], found_alone[0], strict=True)) if only else {}
    return alone | (dict(zip("t", clocks, strict=False)) if alone else {})


def side_by_side(of: Columns) -> list[dict[str, int]]:
    """Return role -> place of each of the sensors whose six columns lie side by side, as physics confirms."""
    clocks = [place for place, column in of.items() if is_even_clock(column)]
    places = [place for place in of if place not in clocks[:1]]
    t = _seconds(of[clocks[0]] if clocks else None, len(next(iter(of.values()), ())), NO_HINTS)
    sixes = [tuple(places[at : at + 6]) for at in range(len(places) - 5)]
    pairs = [pair for six in sixes for pair in (six, six[3:] + six[:3]) if _keeps_size(_stacked(of, pair[:3]))]
    turned = {pair: _turned(of, pair, t, any_rate=not clocks) for pair in pairs}
    found: list[Places] = []
    for pair in sorted(turned, key=turned.__getitem__, reverse=True):
        if turned[pair] >= units.EXPLAINED and not any({*pair} & {*other} for other in found):
            found.append(pair)
    return [dict(zip(ROLES[1:], pair, strict=True)) for pair in sorted(found, key=min)]


def likely_columns(of: Columns, clocks: Sequence[int], arrays: Mapping[int, str]) -> tuple[dict[str, int], str] | None:
    """Return role -> place of triples of columns that are the sensors', and a unit of the accelerations to be named.

    They are none if there are no triples. None if no triple may be as long as gravity.

    Parameters
    ----------
    arrays : place -> the array of which it is a column; a triple is of one.
    """
    increasing = [place for place, column in of.items() if increases(column) and _advances(column)]
    clocks = clocks or [place for place in increasing if is_even_clock(of[place]) or _restarts(of[place])]
    places = [place for place in of if place not in {*clocks, *increasing}]
    vary = [place for place in places if np.ptp(of[place]) > 0.0]
    # other columns may be before theirs, such as a label that never changes
    places = places[places.index(vary[0]) :] if vary else places
    # or between, such as a number before each sensor
    runs = [len([*run]) for moves, run in groupby(places, vary.__contains__) if moves]
    places = places if any(run % 3 for run in runs) else vary
    alignments = [_sized_triples(of, some, arrays) for some in (places, vary, vary[1:], vary[2:])]
    triples, sized, acc = next((found for found in alignments if found[2]), alignments[0])
    if not triples:
        return {}, ""
    t = _seconds(next((of[at] for at in clocks if at in of), None), len(next(iter(of.values()))), NO_HINTS)
    rate_hz = 1.0 / (sample_period(t) or math.inf)
    increments = () if sized else next((triple for triple, a in triples.items() if _is_in_si(a * rate_hz)), ())
    if not sized and not increments:
        return None
    acc = acc or increments or sized[0]
    values = triples[acc]
    # rates turn gravity and are none at times, other than a magnetic field
    others = [triple for triple in triples if triple != acc]
    others.sort(key=lambda triple: _least(triples[triple]) - _turning(t, values, triples[triple]))
    found = [place for triple in (acc, *others[:1]) for place in triple]
    roles = dict(zip(ROLES[1:], found, strict=False)) | dict(zip("t", clocks, strict=False))
    return roles, OF_INCREMENTS if increments else "" if _has_size(values) else units.mean_acceleration_unit(values)


def _sized_triples(
    of: Columns, places: Sequence[int], arrays: Mapping[int, str]
) -> tuple[dict[Places, Vector], list[Places], Places]:
    """Return the triples of columns, those that may be as long as gravity, and the first that is most likely it.

    That keeps its length. So do the rates of a gyroscope that counts from a large number, but they hardly turn.
    """
    of_arrays = (_triples([*group]) for _, group in groupby(places, arrays.get))
    triples = {triple: _stacked(of, triple) for group in of_arrays for triple in group}
    sized = [triple for triple, a in triples.items() if units.are_counts(a) or units.mean_acceleration_unit(a)]
    steady = [triple for triple in sized if _keeps_size(triples[triple]) and all(np.ptp(of[at]) > 0.0 for at in triple)]
    counts = [a for a in map(triples.__getitem__, steady) if units.seem_counts(a) and _least(a) > 1.0 - MOST_SCATTER]
    most = max(map(_spread, counts), default=0.0)
    first = next((triple for triple in steady if SPREAD_RATIO * _spread(triples[triple]) >= most), ())
    return triples, sized, first


def _triples(places: Sequence[int]) -> list[tuple[int, ...]]:
    """Return the places of the columns in threes."""
    return [tuple(places[first : first + 3]) for first in range(0, len(places) - 2, 3)]


def _stacked(of: Columns, places: Sequence[int]) -> Vector:
    """Return columns as (n, k) numbers, counts with their sign."""
    return units.to_signed(np.column_stack([of[place] for place in places]))


def _least(values: Vector) -> float:
    """Return about the least length of (n, 3) numbers, over their median."""
    least, size = np.percentile(np.linalg.norm(values, axis=1), [1, 50]).tolist()
    return least / size if size else 0.0


def _spread(values: Vector) -> float:
    """Return how far the directions of (n, 3) numbers are apart: 0 if they are one, and 1 if they are all around."""
    lengths = np.linalg.norm(values, axis=1, keepdims=True)
    return 1.0 - float(np.linalg.norm((values / np.maximum(lengths, np.finfo(float).tiny)).mean(axis=0)))


def _turning(t: Vector, acc: Vector, rates: Vector) -> float:
    """Return how well (n, 3) rates, whose bias may be large, explain the turning of gravity; see units.turning."""
    return units.turning(t, acc, rates - np.median(rates, axis=0))[1]


def _is_one_g(acc: Vector) -> bool:
    """Return True if (n, 3) numbers are nearly 1 g long in m/s^2, g or counts of 16 bits, and vary."""
    size, scatter = units.typical_size(acc)
    g_of_units = [QUANTITIES["acc"]["m/s^2"] / STANDARD_GRAVITY_MPS2, 1.0]
    if size > 0.0 and units.are_counts(acc):
        g_of_units = [1.0 / units.counts_per_g(size)] if size < ACCEL_COUNTS else []
    return 0.0 < scatter < ONE_G * size and any(abs(size * g - 1.0) < ONE_G for g in g_of_units)


def _is_in_si(acc: Vector) -> bool:
    """Return True if (n, 3) numbers are about 1 g long in m/s^2."""
    return units.acceleration_unit(acc) == "m/s^2" and units.is_gravity(units.typical_size(acc)[0])


def _has_rival(of: Columns, pair: Places) -> bool:
    """Return True if other columns are gravity in m/s^2: those that turn as the rates may be a field of unit length."""
    others = [place for place in of if place not in pair]
    windows = (others[at : at + 3] for at in range(len(others) - 2))
    return not _is_in_si(_stacked(of, pair[:3])) and any(_is_in_si(_stacked(of, each)) for each in windows)


def _is_about_one_g(acc: Vector) -> bool:
    """Return True if (n, 3) numbers are counts, or about 1 g long in the unit that they show."""
    size, unit = units.typical_size(acc)[0], units.acceleration_unit(acc)
    return units.are_counts(acc) or (unit != "" and units.is_gravity(size * QUANTITIES["acc"][unit]))


def _has_size(acc: Vector) -> bool:
    """Return True if (n, 3) numbers are as large as gravity in some unit, or counts."""
    return units.are_counts(acc) or bool(units.acceleration_unit(acc))


def _keeps_size(values: Vector) -> bool:
    """Return True if (n, 3) numbers vary, and keep their length as gravity does."""
    size, scatter = units.typical_size(values)
    return 0.0 < scatter <= MOST_SCATTER * size


def is_clock(column: Vector) -> bool:
    """Return True if (n,) numbers increase, and do not only repeat."""
    return _advances(column) and bool((np.diff(column[np.isfinite(column)]) >= 0).all())


def _advances(column: Vector) -> bool:
    """Return True if more than one of a hundred (n,) numbers is larger than the one before, unlike a rate at rest."""
    steps = np.diff(column[np.isfinite(column)])
    return len(steps) > 0 and bool((steps > 0).mean() > 0.01)


def increases(column: Vector) -> bool:
    """Return True if (n,) numbers are a clock's, which may restart: they hardly ever decrease."""
    return sample_period(column) > 0.0 and not are_many(int(np.count_nonzero(np.diff(column) < 0)), column[1:])


def _restarts(column: Vector) -> bool:
    """Return True if (n,) numbers of a clock, by their step, are those of several recordings."""
    return bool((np.diff(column) < 0).any() and units.time_unit(sample_period(column)))


def is_index(column: Vector) -> bool:
    """Return True if (n,) numbers count the samples, and so are no times in ms."""
    return bool((np.diff(column) == 1.0).all())


def is_even_clock(column: Vector) -> bool:
    """Return True if (n,) numbers increase with the samples, at a sensor's rate in some unit, and do not count them."""
    if not is_clock(column) or is_index(column):
        return False
    correlation = float(np.corrcoef(column, np.arange(len(column)))[0, 1])
    return correlation > LEAST_CORRELATION and bool(units.time_unit(sample_period(column)))


def _seconds(clock: Vector | None, n: int, hints: Hints) -> Vector:
    step = 0.0 if clock is None else sample_period(clock)
    # a clock may stand still
    if clock is None or not step:
        return np.arange(n) / (hints.rate_hz or units.ANY_HZ)
    likely = (si for si in QUANTITIES["t"].values() if 1 / units.FASTEST_HZ <= step * si <= 1.0)
    si = next(likely, 1.0 / units.ANY_HZ / step)
    return np.asarray((clock - clock[0]) * si)


def _pairs(of: Columns, places: list[int]) -> list[tuple[int, ...]]:
    """Return the places of two sensors' three adjacent columns each, of which the first keep a magnitude."""
    starts = range(len(places) - 2)
    gravity = [a for a in starts if _keeps_size(_stacked(of, places[a : a + 3]))]
    return [(*places[a : a + 3], *places[w : w + 3]) for a in gravity for w in starts if abs(a - w) >= 3]


def _turned(of: Columns, pair: Sequence[int], t: Vector, *, any_rate: bool) -> float:
    """Return how well the rates explain the turning of gravity, from 0 to 1; 0 if it is at no unit's speed."""
    acc, gyr = _stacked(of, pair[:3]), _stacked(of, pair[3:])
    # a place, whose numbers hardly change, is no rate about one axis
    if _spread(gyr) * FEWEST < 1.0:
        return 0.0
    factor, correlation = units.turning(t, acc, gyr)
    of_a_unit = any_rate or units.are_counts(gyr) or bool(units.gyro_unit(factor))
    of_a_unit = of_a_unit or units.are_increments(t, acc, gyr, 1 / (sample_period(t) or math.inf))
    return correlation if factor > 0.0 and of_a_unit else 0.0
