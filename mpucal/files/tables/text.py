"""Tables as text: the separator, the lines before the header, and the times before each line."""

from __future__ import annotations

import csv
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from io import StringIO
from itertools import pairwise, zip_longest
from pathlib import Path

import numpy as np

from ...data import Mask, Vector
from ...errors import RecordingError
from ..reading import MOST_ODD, check_size, is_text
from .cells import CLOCK, DAY_NS, MOMENT, NUMBER, is_number, parse_cell, with_point
from .names import ACC, GYR, NANOSECONDS, TIME, Column, Table, parse_axis_name, parse_header
from .units import NS, QUANTITIES, find_unit

# separator -> its name for messages; None: any blanks
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", None: "blanks"}
# lines that may precede the header: a sketch's greeting, `sep=;`, the settings that Betaflight's Explorer writes
PREAMBLE = 200
# characters within which the names of columns begin
HEAD = 4096
# rows by which a column of times is known
LOOKED_AT = 50
# a header may begin with such a mark; any other line that does is a comment
COMMENT = ("#", "%", "//")
# the share of lines that may be damaged
MOST_BAD = 0.01
# Bytes that a line takes at least while it is read, in CPython on 64 bits: a list (56), its reference and line number
# (16 and 32), a Decimal of its time (104 and 8). A cell takes a reference and a float64.
LINE, CELL = 216, 16
# units of a column beside whole seconds
BELOW_A_SECOND = ("ms", "us", "ns")
# names within quotation marks may span lines
_QUOTED = re.compile(r'"[^"]{0,60}"')
# Serial monitors, terminals and loggers write the time before each line: `12:03:04.123 -> `, `[2024-05-01 12:03:04] `.
# A blank alone ends it where the line goes on with numbers and another separator.
MONITORED = re.compile(
    rf"^\[?(?:(\d{{4}}-\d\d-\d\d)[ T])?({CLOCK})Z?"
    r"(?:\][ \t]*|[ \t]*-?>[ \t]*|[ \t]+(?=[-+.\d][^\n ]*[,;\t]))",
    re.MULTILINE,
)
COLOUR = re.compile(r"\x1b\[[0-9;]{0,9}m")
# a number and its unit in one cell
_WITH_UNIT = re.compile(r"[-+.\d][-+.,\deE]*( ?[^-+.,\d\s][^\d]{0,9}\d?)").fullmatch
_NUMBER_OR_MOMENT = re.compile(rf"(?<![\w.])(?:{MOMENT}|{NUMBER})(?!\w)")


@dataclass(frozen=True)
class TextTable(Table):
    """A table whose cells are text.

    Attributes
    ----------
    rows : the cells of each line that is not empty; none of a line that was torn. lines : the line number of each row.
    separator : one of SEPARATORS, or `:` of labelled numbers. ranges : g and deg/s, of counts, if a program sets them.
    """

    rows: list[list[str]]
    lines: list[int]
    separator: str | None = ","
    ranges: tuple[float, float] | None = None

    @property
    def remarks(self) -> list[str]:
        """See Table."""
        called = SEPARATORS.get(self.separator)
        told = ["the ranges are those that MPU6050::initialize() sets"] if self.ranges else []
        return told if self.separator in (",", ":") else [f"its cells are separated by {called}", *told]

    def has(self, column: Column) -> Mask:
        """See Table."""
        return np.array([column.place < len(row) and bool(row[column.place].strip()) for row in self.rows])

    def numeric_places(self) -> list[int]:
        """See Table; the first row decides."""
        width = int(np.percentile([len(row) for row in self.rows], 100 * MOST_BAD))
        return [place for place, cell in enumerate(self.rows[0][:width]) if is_number(cell, dates=False)]

    def clocks(self, columns: Sequence[Column]) -> list[Column]:
        """See Table; if none is named, the first column of dates or times of day that changes."""
        # the last of them may be torn
        some = self.rows[:: max(len(self.rows) // LOOKED_AT, 1)][: LOOKED_AT + 1] or self.rows
        cells = [(c, [row[c.place] for row in some if c.place < len(row)]) for c in columns if c.quantity == TIME]
        # a few cells may be damaged
        named = [c for c, of in cells if of and np.mean([*map(is_number, filter(str.strip, of))] or 1) > 1 - MOST_ODD]
        for place, cell in enumerate([] if named else self.rows[0]):
            dates = {row[place] for row in some if place < len(row) and is_number(row[place])}
            if len(dates) > 1 and is_number(cell) and not is_number(cell, dates=False):
                return [Column(self.header[place] if self.header else "", place, TIME)]
        return named

    def numbers(self, columns: Sequence[Column]) -> Vector:
        """See Table; a cell that a line lacks, or of a few damaged lines, is empty. The error names the line."""
        found, bad = np.full((len(self.rows), len(columns)), np.nan), []
        for j, column in enumerate(columns):
            for i, row in enumerate(self.rows):
                text = row[column.place].strip() if column.place < len(row) else ""
                try:
                    found[i, j] = float(with_point(text)) if text else np.nan
                except ValueError:
                    bad.append((i, column, text))
        if len({i for i, *_ in bad}) > MOST_BAD * len(self.rows):
            raise self._not_a_number(*bad[0])
        return found

    def times(self, column: Column, kept: Mask) -> tuple[list[Decimal], str]:
        """See Table; the error names the line. A column of nanoseconds beside whole seconds is added to these."""
        found, unit = self._exact(column, kept), column.unit
        parts = [c for c in self.columns if c.quantity == NANOSECONDS and unit == "s"]
        try:
            Decimal(with_point(self._cell(int(kept.argmax()), column).strip()))
        except InvalidOperation:
            unit = "ns"
            below = [c for c in self.columns if c.quantity == TIME and c.unit in BELOW_A_SECOND and c != column]
            parts = [] if any(ns % NS for ns in found) else below
        if not parts:
            return found, unit
        ticks = round(QUANTITIES["t"][parts[0].unit or "ns"] * NS)
        more = [part * ticks for part in self._exact(parts[0], kept)]
        if max(more) >= NS:
            return found, unit
        return [at * (1 if unit == "ns" else NS) + part for at, part in zip(found, more, strict=True)], "ns"

    def _exact(self, column: Column, kept: Mask) -> list[Decimal]:
        found: list[Decimal] = []
        bad: list[int] = []
        for i in np.flatnonzero(kept).tolist():
            text = self._cell(i, column)
            try:
                at = parse_cell(text)
                if found and ":" in text and (at > DAY_NS) != (found[-1] > DAY_NS):
                    raise ValueError(text)
                found.append(at)
            except ValueError as error:
                bad.append(len(found))
                found.append(found[-1] if found else Decimal(0))
                if len(bad) > MOST_BAD * len(self.rows) or bad[0] == 0:
                    raise self._not_a_number(i, column, text) from error
        # a spreadsheet writes some times otherwise
        for i in bad:
            found[i] = (found[i - 1] + found[min(i + 1, len(found) - 1)]) / 2
        return found

    def _cell(self, i: int, column: Column) -> str:
        row = self.rows[i]
        if column.place < len(row):
            return row[column.place]
        raise RecordingError(
            f"{self.name}: line {self.lines[i]} has {len(row)} values where the first line names {len(self.header)}",
            "complete that line or leave it out",
        )

    def _not_a_number(self, i: int, column: Column, text: str) -> RecordingError:
        name = column.name.strip() or f"column {column.place + 1}"
        return RecordingError(
            f"{self.name}: line {self.lines[i]}: {name} is {text!r}, which is not a number",
            "correct that line or leave it out",
        )


def decode_text(data: bytes, name: str) -> str:
    """Return the text of a file: UTF-8, UTF-16 or Windows-1252, without NUL bytes and the serial monitor's times.

    Raises
    ------
    RecordingError : it is binary.
    """
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        # a spreadsheet's "Unicode text"; the bytes that were read may end within a letter
        text = data.decode("utf-16", "replace")
    elif data and not is_text(data):
        raise RecordingError(f"{name} is not text", "give a table as text")
    else:
        # a logger that is switched off leaves zeros, and so does one that has not written yet
        data = data.replace(b"\0", b"")
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            # spreadsheets write "m/s²" and "µs" so
            text = data.decode("cp1252", "replace")
    if "\n" not in text:
        text = text.replace("\r", "\n")
    head = _QUOTED.sub(lambda quoted: " ".join(quoted[0].split("\n")), text[:HEAD])
    text = COLOUR.sub("", head + text[HEAD:])
    begun = text[:HEAD].rstrip("\n")
    stamped = [*MONITORED.finditer(begun)]
    if 2 * len(stamped) <= begun.count("\n"):
        return text
    rest = begun[stamped[-1].end() :].partition("\n")[0]
    separator = next((mark for mark in ",;\t" if mark in rest), " ")
    text = MONITORED.sub(lambda of: f"{f'{of[1]}T' if of[1] else ''}{of[2]}{separator}", text)
    return re.sub(rf"^[^\s,;]+{re.escape(separator)}\r?$", "", text, flags=re.MULTILINE)


def find_table(text: str, name: str, wanted: Sequence[str | int] = (), bare: bool = False) -> TextTable | None:
    """Return the table in a text; None if no line names an accelerometer's or a gyroscope's columns.

    Parameters
    ----------
    wanted : the columns' names, of which the header has some, or their places, where the first row has numbers.
    bare : accept a header that names x, y and z without a sensor.
    """
    begun = text.split("\n", PREAMBLE)[:PREAMBLE]
    names, places = {of for of in wanted if isinstance(of, str)}, [of for of in wanted if isinstance(of, int)]
    above = ""
    for number, line in enumerate(begun):
        for separator in SEPARATORS:
            cells = _header_cells(above, line, separator)
            plain = {cell.strip() for cell in cells}
            if names:
                found = len(cells) >= len(wanted) and bool(
                    names & (plain | {of.partition("(")[0].strip() for of in plain})
                )
            elif places:
                found = len(cells) > max(places) and all(is_number(cells[place]) for place in places)
            elif bare:
                found = {axis[0] for cell in cells if (axis := parse_axis_name(cell))} == {0, 1, 2}
            else:
                found = len({c.axis for c in parse_header(cells) if c.quantity in (ACC, GYR)}) == 3
            if found and places and not names:
                before = _cells(begun[number - 1], separator) if number else []
                return _read(text, name, before if len(before) == len(cells) else [], number, separator)
            if found:
                return _read(text, name, cells, number + 1, separator)
        above = line
    return find_table(text, name, range(len(wanted))) if names else None


def _header_cells(above: str, line: str, separator: str | None) -> list[str]:
    """Return the cells of a line; those of the line above are put before axes, where that names the sensors."""
    cells, sensors = _cells(line, separator), _cells(above, separator)
    axes = [cell.strip().lower() for cell in cells]
    if separator is None or len(sensors) != len(cells) or not {"x", "y", "z"} <= set(axes) or not any(sensors):
        return cells
    of, found = "", []
    for sensor, axis in zip(sensors, cells, strict=True):
        of = sensor.strip() or of
        found.append(f"{of} {axis.strip()}")
    return found


def find_numeric_table(text: str, name: str, least: int) -> TextTable | None:
    """Return the table whose lines hold `least` numbers or more, with any header or none; None if there is none.

    Among fewer numbers than those of both sensors, other cells are a mark that each line repeats.
    """
    begun = text.split("\n", PREAMBLE)[:PREAMBLE]
    for first, (line, following) in enumerate(pairwise(begun)):
        for separator in SEPARATORS:
            cells, more = _cells(line, separator), _cells(following, separator)
            alike = [is_number(one) and is_number(other) for one, other in zip(cells, more, strict=False)]
            marked = all(one == other for one, other, number in zip(cells, more, alike, strict=False) if not number)
            if sum(alike) >= least and len(more) == len(cells) and (marked or sum(alike) >= 2 * len("xyz")):
                above = _cells(begun[first - 1], separator) if first else []
                return _read(text, name, above if len(above) == len(cells) else [], first, separator)
    return None


def _cells(line: str, separator: str | None) -> list[str]:
    line = line.lstrip()
    for mark in COMMENT:
        line = line.removeprefix(mark)
    if separator is None:
        return line.split()
    if separator not in line:
        return []
    try:
        return next(csv.reader([line.rstrip("\r\n")], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:
        return []


def find_numbers(text: str, name: str) -> TextTable | None:
    """Return the table of the numbers and times in lines that hold equally many, six or more; None if there is none."""
    found = [(i, _NUMBER_OR_MOMENT.findall(line)) for i, line in enumerate(text.split("\n"), 1)]
    found = [(i, cells) for i, cells in found if len(cells) >= 2 * len("xyz")]
    widths = [len(cells) for _, cells in found[:PREAMBLE]]
    width = max(set(widths), key=widths.count, default=0)
    rows = [cells if len(cells) == width else [] for _, cells in found]
    return TextTable(name, [], rows, [i for i, _ in found], ":") if len(rows) > 1 and rows[0] else None


def _read(text: str, name: str, header: list[str], first: int, separator: str | None) -> TextTable:
    """Return the table below the first `first` lines."""
    check_size(Path(name), text.count("\n") * (LINE + CELL * len(header)))
    rows, lines = [], []
    source = StringIO(text, newline="")
    for _ in range(first):
        source.readline()
    try:
        if separator is None:
            read = ((first + i, line.split()) for i, line in enumerate(source, 1))
        else:
            reader = csv.reader(source, delimiter=separator, skipinitialspace=True)
            read = ((first + reader.line_num, row) for row in reader)
        for line, row in read:
            # a logger that is restarted repeats its header
            if any(map(str.strip, row)) and not row[0].startswith(COMMENT) and row != header:
                rows.append(row)
                lines.append(line)
    except csv.Error as error:
        raise RecordingError(f"{name} is not a table ({error})", "give a table as text") from error
    if len(rows) > 1 and not text.endswith("\n") and len(rows[-1]) < len(rows[-2]):
        # the logger was switched off
        rows[-1] = []
    if rows and _are_units(rows[0]):
        header = [
            f"{of} ({unit.strip()})" if unit.strip() else of for of, unit in zip_longest(header, rows[0], fillvalue="")
        ]
        rows, lines = rows[1:], lines[1:]
    for place, cell in enumerate(rows[0][: len(header)] if rows else []):
        if (found := _WITH_UNIT(cell)) and find_unit(found[1]):
            header = [f"{of} ({found[1].strip()})" if i == place else of for i, of in enumerate(header)]
            rows = [[text.removesuffix(found[1]) if i == place else text for i, text in enumerate(row)] for row in rows]
    return TextTable(name, header, rows, lines, separator)


def _are_units(cells: list[str]) -> bool:
    """Return True if a line below the header holds the units."""
    return any(map(find_unit, cells)) and not any(is_number(cell) for cell in cells)
