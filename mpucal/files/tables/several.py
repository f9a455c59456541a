"""Several sensors of one kind in a table, of which the first is read, as of gateways and of people who wear them.

A column tells their lines apart, or a word in the names of their columns.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...clocks.stamps import FEWEST
from ...data import Vector
from ...errors import RecordingError
from .cells import Cells, Kind
from .names import ACC, GYR, WITHOUT_GRAVITY, Column, first_triple, parse_column_name, parse_header
from .shown_units import BEYOND
from .table import Table

# names of such a column, whose words may come one after the other
NAMES_SENSORS = re.compile(
    r"(?:sensor|device|imu|node|board|module|mac)(?:[ _.-]?(?:id|no|nr|num|number|name|index|addr|address|mac))?",
    re.IGNORECASE,
).fullmatch
# ArduPilot's name of it -> one of those
INSTANCE = {"I": "imu"}
MOST_SENSORS = 32
# lines among which a column of any name has to alternate
BEGUN = 2000
# columns that differ from sensor to sensor by more than a sensor's do from sample to sample, and by how much
FEWEST_COLUMNS, FARTHER = 3, 2.0
# what separates the words of a name, and the most words of a name that is looked at
_BETWEEN, MOST_WORDS = re.compile(r"[_ .\-]+"), 6


def of_one_place(table: Table) -> Table:
    """Return a table without the words by which the names of the first accelerometer and gyroscope say where they are.

    AccelX_right_leg is AccelX, if there is a whole IMU called so, or a gyroscope without such words. The same table if
    its columns are known as they are, other than of an acceleration without gravity beside no gyroscope.
    """
    known = first_triple(table.columns, ACC)
    if known and (first_triple(table.columns, GYR) or not WITHOUT_GRAVITY.match(known[0].name)):
        return table
    split = [_BETWEEN.split(name.strip()) for name in table.header]
    for place in dict.fromkeys(place for words in split for place in _places(words)):
        short = ["_".join(_without(place, of)) for of in split]
        names = [of or name for of, name in zip(short, table.header, strict=True)]
        if first_triple(parse_header(short), ACC) and first_triple(parse_header(names), GYR):
            said = f"of its columns, those called {' '.join(place)} were read"
            return replace(table, header=names, remarks=(*table.remarks, said))
    return table


def _places(words: list[str]) -> Iterator[tuple[str, ...]]:
    """Yield the words of a name without which it is that of an axis."""
    size = len(words) if len(words) <= MOST_WORDS else 0
    for place in (tuple(words[i:j]) for i in range(size) for j in range(i + 1, size + 1)):
        column = parse_column_name("_".join(_without(place, words)), 0)
        if column is not None and column.quantity in (ACC, GYR):
            yield place


def _without(place: tuple[str, ...], words: list[str]) -> list[str]:
    """Return the words without those of a place; none if they lack them."""
    at = next((i for i in range(len(words)) if tuple(words[i : i + len(place)]) == place), None)
    return [] if at is None else words[:at] + words[at + len(place) :]


def of_one_sensor(table: Table) -> Table:
    """Return the lines of the first of several sensors; the same table if no column tells lines of sensors apart.

    The column is called so, or alternates, and the sensors' numbers lie farther apart than those of one of them.
    """
    for place, cells in enumerate(table.cells):
        named = bool(NAMES_SENSORS(table.name_of(place)))
        if not named and not 1 < len(set(_words(cells[:BEGUN]))) <= MOST_SENSORS:
            continue
        words = _words(cells)
        of_words = {word: number for number, word in enumerate(dict.fromkeys(filter(str.strip, words)))}
        if not 1 < len(of_words) <= MOST_SENSORS:
            continue
        sensors = np.array([of_words.get(word, -1) for word in words])
        first = sensors == 0
        whole = all(table.has(column)[first].any() for column in table.columns if column.quantity in (ACC, GYR))
        if whole and (named or _lie_apart(_others(table, place), sensors)):
            called = table.name_of(place) or f"column {place + 1}"
            said = f"its lines are of several sensors ({called}: {', '.join(of_words)}), of which the first was read"
            return replace(table.part(first), remarks=(*table.remarks, said))
    return table


def _words(cells: Cells) -> list[str]:
    return [str(cell) for cell in cells]


def _others(table: Table, place: int) -> Vector:
    """Return the numbers in the other columns, (n, k), 0 where there is none; (n, 0) if the table is damaged."""
    with suppress(RecordingError):
        found = table.numbers([Column("", at, "") for at in table.places(Kind.NUMBER) if at != place])
        return np.where(np.abs(found) < BEYOND, found, 0.0)
    return np.zeros((len(table), 0))


def _lie_apart(values: Vector, sensors: NDArray[np.int_]) -> bool:
    """Return True if most lines are of another of the `sensors` (n,) than the line before, and their `values` differ.

    From one sensor to another, (n, k) values then change by more than those of one sensor until its next line, although
    that comes later.
    """
    changes, order = sensors[1:] != sensors[:-1], np.argsort(sensors, kind="stable")
    again = sensors[order][1:] == sensors[order][:-1]
    if 2 * np.count_nonzero(changes) < len(changes) or np.count_nonzero(again) < FEWEST:
        return False
    apart, alone = (
        np.median(np.abs(np.diff(of, axis=0))[where], axis=0)
        for of, where in ((values, changes), (values[order], again))
    )
    return int(np.count_nonzero(apart > FARTHER * alone)) >= FEWEST_COLUMNS
