"""Several sensors of one kind in a table, of which the first is read, or the one that the user names.

A column tells their lines apart, or the beginning of the lines, or a word in the names of their columns. Where they
only take turns, the user has to choose.
"""

from __future__ import annotations

import math
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from ...clocks.stamps import FEWEST
from ...data import Vector
from ...errors import RecordingError
from .cells import Cells, Kind, is_number, with_point
from .columns import measured
from .guess import MOST_COLUMNS, side_by_side
from .names import ACC, GYR, WITHOUT_GRAVITY, Column, axes_of, first_triple, names_both, parse_column_name, parse_header
from .shown_units import LARGEST_NUMBER
from .table import Table
from .text import HEAD

# names of such a column, whose words may come one after the other
NAMES_SENSORS = re.compile(
    r"(?:sensor|device|imu|node|board|module|mac)(?:[ _.-]?(?:id|no|nr|num|number|name|index|addr|address|mac))?",
    re.IGNORECASE,
).fullmatch
# names that may be of lines, persons or places, and name sensors where these take turns
MAY_NAME_SENSORS = re.compile(r"(?:.*[ _.-])?(?:id|addr|address|source|port|channel|name)", re.IGNORECASE).fullmatch
# ArduPilot's name of it -> one of those
INSTANCE = {"I": "imu"}
MOST_SENSORS = 32
# lines within which the sensors take turns in a column whose name does not say that it names them; a board's log may
# come before them
FIRST_LINES = 2000
# columns that tell sensors apart, at least: they differ from one sensor to the next by this factor more than from one
# sample of a sensor to the next
FEWEST_COLUMNS, FARTHER = 3, 2.0
# separators of the words in a name; a digit ends a word of letters
_BETWEEN = re.compile(r"[_ .\-]+")
# the largest number of words considered
MOST_WORDS = 6
_NUMBERED = re.compile(r"([A-Za-z]+)(\d)").fullmatch
# a place before an axis: Leftax
_JOINED = re.compile(r"([A-Z][a-z]{2,}?)((?:a|g|[Aa]cc|[Gg]yro?)[xyz])").fullmatch
# the word at the beginning of a line, without a mark that a table has: `IMU1: `, `[0x69] `, `left `
_BEGINNING = re.compile(
    r"^[\[(<]?((?:0x[\dA-Fa-f]{2}|[A-Za-z]\w{0,20})(?:[ #-]\d{1,2})?)[\])>]?[ \t]?[:|>-]?(?:[ \t]|\r?$)", re.MULTILINE
)
# two sensors that lie differently: from one line to the next the acceleration changes by this share of gravity or more,
# and its length by less than the second share
LEAST_APART, MOST_LENGTH_CHANGE = 0.25, 0.1
CHOOSES = "--sensor chooses"


def of_one_place(table: Table, sensor: str | None = None) -> Table:
    """Return a table without the words by which the names of an accelerometer and gyroscope say where they are.

    AccelX_right_leg is AccelX, if there is a whole IMU called so, or a gyroscope without such words. The same table if
    its columns are known as they are, other than of an acceleration without gravity beside no gyroscope.

    Raises
    ------
    RecordingError : there are such columns, but not of the `sensor`.
    """
    known = first_triple(table.columns, ACC)
    if known and not sensor and (first_triple(table.columns, GYR) or not WITHOUT_GRAVITY.match(known[0].name)):
        return table
    split = [[*_words_of(name)] for name in table.header]
    found: dict[str, tuple[str, ...]] = {}
    for place in dict.fromkeys(place for words in split for place in _places(words)):
        if len(found) < MOST_SENSORS and all(len(place) == len(_BETWEEN.split(other)) for other in found):
            short = ["_".join(_without(place, of)) for of in split]
            names = [of or name for of, name in zip(short, table.header, strict=True)]
            if first_triple(parse_header(short), ACC) and first_triple(parse_header(names), GYR):
                found[" ".join(place)] = place
    if not found:
        return _of_one_side(table, sensor)
    chosen = _choose([*found], sensor, table.name)
    own, others = found[chosen], [place for name, place in found.items() if name != chosen]
    header = [
        "_".join(_without(own, of)) or ("" if any(_without(other, of) for other in others) else name)
        for of, name in zip(split, table.header, strict=True)
    ]
    more = f" ({CHOOSES} of {', '.join(found)})" if len(found) > 1 else ""
    return table.noted(f"of its columns, those called {chosen} were read{more}", header=header, chosen=True)


def _of_one_side(table: Table, sensor: str | None) -> Table:
    """Return a table of several sensors side by side, whose names do not show them, with the names of one's columns."""
    of = {} if table.of_sensors else measured(table)
    sensors = {str(i): roles for i, roles in enumerate(side_by_side(of), 1)} if len(of) > MOST_COLUMNS or sensor else {}
    if len(sensors) < 2:
        return table
    chosen = _choose([*sensors], sensor, table.name)
    others = {place for roles in sensors.values() for place in roles.values()}
    own = {place: role for role, place in sensors[chosen].items()}
    remark = f"{len(sensors)} sensors are side by side, of which number {chosen} was read ({CHOOSES})"
    header = [own.get(at, "" if at in others else table.name_of(at)) for at in range(len(table.cells))]
    return table.noted(remark, header=header, chosen=True)


def _choose(sensors: Sequence[str], sensor: str | None, name: str) -> str:
    """Return the `sensor` that the user names, or the first.

    Raises
    ------
    RecordingError : there is none of that name.
    """
    known = {_plain(each): each for each in reversed(sensors)}
    if sensor is None:
        return sensors[0]
    if _plain(sensor) not in known:
        options = f"--sensor {shlex.quote(sensors[0])}"
        what = f"{name} holds no sensor called {sensor}; its sensors are {', '.join(sensors)}"
        raise RecordingError(what, f"choose one with {options}", options)
    return known[_plain(sensor)]


def _plain(word: str) -> str:
    return _BETWEEN.sub(" ", word).strip().lower()


def _words_of(name: str) -> Iterator[str]:
    """Yield the words of a name; ax2 and Acc2_X are of the second sensor."""
    for word in _BETWEEN.split(name.strip()):
        split = (numbered := _NUMBERED(word)) and _measures(numbered[1]) and numbered.groups()
        yield from split or ((joined := _JOINED(word)) and joined.groups()) or [word]


def _measures(word: str) -> bool:
    """Return True if a word is that of a sensor's quantity or axis, not of a sensor."""
    return bool(axes_of(word) or parse_column_name(word, 0))


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


def lines_of_sensors(text: str) -> Mapping[str, str]:
    """Return sensor -> the text without the lines of the others, if the beginnings of lines name several; else none.

    A line without such a beginning is of the sensor above it, if all have such lines, or else of all.
    """
    begun = text[: text.find("\n", HEAD) + 1] or text
    if len({found[1] for found in _BEGINNING.finditer(begun)}) < 2:
        return {}
    lines = text.split("\n")
    words = [found[1] if (found := _BEGINNING.match(line)) else "" for line in lines]
    of_sensors = {word for word in set(words) if not _measures(word)}
    names = [word if word in of_sensors else "" for word in words]
    named = [name for name in names if name]
    sensors = [name for name, count in Counter(named).items() if count >= FEWEST][:MOST_SENSORS]
    turns = sum(one != other for one, other in pairwise(named))
    if len(sensors) < 2 or 2 * turns < len(named):
        return {}
    follow = {above for above, name in pairwise(names) if above and not name}
    if follow >= {*sensors}:
        names = [*accumulate(names, lambda above, name: name or above, initial="")][1:]
    owned = [*zip(lines, names, strict=True)]
    return {sensor: "\n".join(line for line, owner in owned if owner in ("", sensor)) for sensor in sensors}


def of_one_beginning(
    text: str, name: str, sensor: str | None, find: Callable[[str, str], Table | None]
) -> Table | None:
    """Return the table that `find` finds in the lines of one sensor; None if no beginnings of lines name several."""
    texts = lines_of_sensors(text)
    tables = {of: table for of, part in texts.items() if (table := find(part, name)) and _is_whole(table)}
    if len(tables) < 2:
        return None
    chosen = _choose([*tables], sensor, name)
    remark = f"its lines begin with several sensors' names ({', '.join(tables)}), of which {_which(chosen, tables)}"
    return tables[chosen].noted(f"{remark} was read ({CHOOSES})", chosen=True)


def of_one_sensor(table: Table, sensor: str | None = None) -> Table:
    """Return the lines of one of several sensors; the same table if no column tells lines of sensors apart.

    The column is called so, or holds the name that the user gives, or it alternates: and it may be called so, or the
    sensors' lines come together, or their numbers lie farther apart than those of one of them.

    Raises
    ------
    RecordingError : there are several, but none of the name `sensor`.
    """
    known = {column.place for column in table.columns}
    for place, cells in enumerate(table.cells):
        name = table.name_of(place)
        named = bool(NAMES_SENSORS(name))
        if not named and (place in known or not 1 < len(set(_words(cells[:FIRST_LINES]))) <= MOST_SENSORS):
            continue
        words = _words(cells)
        of_words = {word: number for number, word in enumerate(dict.fromkeys(filter(str.strip, words)))}
        # numbers of sensors are whole
        if not 1 < len(of_words) <= MOST_SENSORS or any(
            is_number(w, False) and float(with_point(w)) % 1.0 for w in of_words
        ):
            continue
        sensors = np.array([of_words.get(word, -1) for word in words])
        first = sensors == 0
        whole = all(table.has(column)[first].any() for column in table.columns if column.quantity in (ACC, GYR))
        of_text = table.kinds[place] is Kind.WORD
        named = named or (of_text and sensor is not None and _plain(sensor) in map(_plain, of_words))
        if whole and (named or _take_turns(table, place, sensors)):
            chosen = _choose([*of_words], sensor, table.name)
            called, which = name or f"column {place + 1}", _which(chosen, of_words)
            remark = f"its lines are of several sensors ({called}: {', '.join(of_words)}), of which {which} was read"
            return table.part(sensors == of_words[chosen]).noted(f"{remark} ({CHOOSES})", chosen=True)
    return table


def of_one_turn(table: Table, acc: Sequence[Column], sensor: str | None) -> Table:
    """Return the lines of one sensor, if several take turns, and no column names them; else the same table.

    Raises
    ------
    RecordingError : they take turns, and `sensor` does not say which one is to be read; or it says it of other lines.
    """
    count = 1 if table.chosen else turns(table.numbers(acc))
    if count > 1:
        numbers = [str(number) for number in range(1, count + 1)]
        if sensor is None:
            what = f"{table.name}: its lines are of {count} sensors that take turns, and nothing names them"
            remedy = f"choose one with --sensor {' or '.join(numbers)}, by its place among them"
            raise RecordingError(what, remedy, f"--sensor {numbers[0]}")
        chosen = int(_choose(numbers, sensor, table.name))
        part = table.part(np.arange(len(table)) % count == chosen - 1)
        return part.noted(f"of the {count} sensors that take turns, number {chosen} was read", chosen=True)
    if sensor is not None and not table.chosen:
        raise RecordingError(f"{table.name}: nothing tells several sensors apart", "leave out --sensor")
    return table


def turns(acc: Vector) -> int:
    """Return the number of sensors that take turns in (n, 3) accelerations; 1 if they are of one.

    From line to line gravity then has another direction, and its length stays; it comes back with the same sensor.
    """
    acc = np.where((np.abs(acc) < LARGEST_NUMBER).all(axis=1, keepdims=True), acc, np.nan)
    lengths = np.linalg.norm(acc, axis=1)
    if np.count_nonzero(np.isfinite(lengths)) < FEWEST:
        return 1

    def step(lag: int) -> float:
        return _median(np.linalg.norm(acc[lag:] - acc[:-lag], axis=1))

    size, differ, apart = _median(lengths), _median(np.abs(np.diff(lengths))), step(1)
    if not (apart > LEAST_APART * size and differ < MOST_LENGTH_CHANGE * size):
        return 1
    return next((lag for lag in range(2, MOST_SENSORS + 1) if FARTHER * step(lag) < apart), 1)


def _median(values: Vector) -> float:
    """Return the median of the numbers that are known; NaN if none is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def _is_whole(table: Table) -> bool:
    """Return True if a table names both sensors, or has as many columns of numbers."""
    return names_both(table.columns) or (not table.header and len(table.places(Kind.NUMBER)) >= 2 * len("xyz"))


def _which(chosen: str, sensors: Iterable[str]) -> str:
    return "the first" if chosen == next(iter(sensors)) else chosen


def _words(cells: Cells) -> list[str]:
    return [str(cell) for cell in cells]


def _others(table: Table, place: int) -> Vector:
    """Return the numbers in the other columns, (n, k), 0 where there is none; (n, 0) if the table is damaged."""
    with suppress(RecordingError):
        found = table.numbers([Column("", at, "") for at in table.places(Kind.NUMBER) if at != place])
        return np.where(np.abs(found) < LARGEST_NUMBER, found, 0.0)
    return np.zeros((len(table), 0))


def _take_turns(table: Table, place: int, sensors: NDArray[np.int_]) -> bool:
    """Return True if most lines are of another word than the line before, and the words in a column name sensors."""
    if not 2 * np.count_nonzero(np.diff(sensors)) >= len(sensors) - 1 >= FEWEST:
        return False
    called_so = bool(MAY_NAME_SENSORS(table.name_of(place))) and table.kinds[place] is Kind.WORD
    return called_so or _come_together(table, sensors) or _lie_apart(_others(table, place), sensors)


def _come_together(table: Table, sensors: NDArray[np.int_]) -> bool:
    """Return True if the lines of all `sensors` (n,) come soon one after the other, and then no line for longer."""
    # damaged times are reported where they are read
    with suppress(RecordingError):
        for clock in table.clocks(table.columns)[:1]:
            steps = np.diff(table.times(clock, np.ones(len(table), bool))[0])
            usual = sorted(float(np.median(steps[sensors[1:] == each])) for each in np.unique(sensors[1:]))
            return len(usual) > 1 and usual[-1] > FARTHER * usual[-2] >= 0.0
    return False


def _lie_apart(values: Vector, sensors: NDArray[np.int_]) -> bool:
    """Return True if (n, k) values of several `sensors` (n,) that take turns differ.

    From one sensor to another, they then change by more than those of one sensor until its next line, although that
    comes later.
    """
    changes, order = sensors[1:] != sensors[:-1], np.argsort(sensors, kind="stable")
    again = sensors[order][1:] == sensors[order][:-1]
    if np.count_nonzero(again) < FEWEST:
        return False
    apart, alone = (
        np.median(np.abs(np.diff(of, axis=0))[where], axis=0)
        for of, where in ((values, changes), (values[order], again))
    )
    return int(np.count_nonzero(apart > FARTHER * alone)) >= FEWEST_COLUMNS
