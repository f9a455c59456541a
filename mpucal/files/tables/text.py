"""Tables as text: the separator, decimal commas, what stands before the header, and cells as exact numbers."""

from __future__ import annotations

import csv
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time
from decimal import Decimal, InvalidOperation
from io import StringIO
from itertools import pairwise, zip_longest

import numpy as np

from ...data import Mask, Vector
from ...errors import RecordingError
from .names import Column, bare_axis, columns_of
from .units import unit_named

# and what they are called; None: any blanks
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", None: "blanks"}
# lines before the header: what a sketch says at its start, `sep=;`, the settings that Betaflight's Explorer writes
PREAMBLE = 200
NS = 1_000_000_000
# of a text's bytes, zeros
MOST_NUL = 0.1
# before the names of columns, and before a line that is no sample
COMMENT = ("#", "%", "//")
# of a time, as nobody has more
DIGITS = 40
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
# before each line, of Arduino's serial monitor
MONITORED = re.compile(r"^\d\d:\d\d:\d\d\.\d{3} -> ", re.MULTILINE)


@dataclass(frozen=True)
class TextTable:
    """Cells of a table.

    Attributes
    ----------
    header : the columns' names; empty where there are none. rows : the cells of each line that has some.
    lines : the number of each, from 1. separator : one of SEPARATORS, between cells.
    lost : the numbers of lines that hold a part of a row, and are left out.
    """

    name: str
    header: list[str]
    rows: list[list[str]]
    lines: list[int]
    separator: str | None = ","
    lost: Sequence[int] = ()

    @property
    def columns(self) -> list[Column]:
        """What is known of its columns."""
        return columns_of(self.header)

    def has(self, column: Column) -> bool:
        """Whether the first line of a column holds a number or a date."""
        try:
            return _is_number(self.rows[0][column.place])
        except IndexError:
            return False

    @property
    def after_lost(self) -> Mask:
        """(n,) whether lines are lost between a row and the one before."""
        found = np.zeros(len(self.rows), bool)
        places = np.searchsorted(self.lines, np.array(self.lost, int))
        found[places[(places > 0) & (places < len(found))]] = True
        return found

    def numbers(self, columns: Sequence[Column]) -> Vector:
        """(n, k) numbers; an empty cell is NaN.

        Raises
        ------
        RecordingError : a cell is no number; it is named by its line.
        """
        found = np.empty((len(self.rows), len(columns)))
        for j, column in enumerate(columns):
            for i, row in enumerate(self.rows):
                text = row[column.place].strip() if column.place < len(row) else self._short(i)
                try:
                    found[i, j] = float(_point(text)) if text else np.nan
                except ValueError as error:
                    raise self._bad(i, column, text) from error
        return found

    def times(self, column: Column) -> list[Decimal]:
        """(n,) exact times; dates and times of day in ns.

        Raises
        ------
        RecordingError : one is no time; it is named by its line.
        """
        found = []
        for i, row in enumerate(self.rows):
            text = row[column.place] if column.place < len(row) else self._short(i)
            try:
                found.append(_exact(text))
            except ValueError as error:
                raise self._bad(i, column, text) from error
        return found

    def is_dated(self, column: Column) -> bool:
        """Whether its times are dates, or times of day."""
        try:
            Decimal(_point(self.rows[0][column.place].strip()))
        except InvalidOperation:
            return True
        return False

    def _short(self, i: int) -> str:
        raise RecordingError(
            f"{self.name}: line {self.lines[i]} has {len(self.rows[i])} values where the first line names"
            f" {len(self.header)}",
            "complete that line or leave it out",
        )

    def _bad(self, i: int, column: Column, text: str) -> RecordingError:
        name = column.name.strip() or f"column {column.place + 1}"
        return RecordingError(
            f"{self.name}: line {self.lines[i]}: {name} is {text!r}, which is no number",
            "correct or leave out that line",
        )


_OF_DAY = re.compile(r"\d\d:\d\d:\d\d(\.\d+)?").fullmatch


def _point(text: str) -> str:
    return text.replace(",", ".") if "," in text and "." not in text else text


def _exact(text: str) -> Decimal:
    """A number; of a date the ns since 1970, or since the year 1 if nothing says its zone; of a time since midnight."""
    text = text.strip()
    try:
        number = Decimal(_point(text))
        if number.is_finite() and abs(number.adjusted()) < DIGITS:
            return number
    except InvalidOperation:
        date = (
            datetime.combine(datetime.min, time.fromisoformat(text)) if _OF_DAY(text) else datetime.fromisoformat(text)
        )
        since = date - (EPOCH if date.tzinfo else datetime.min)
        return Decimal((since.days * 86400 + since.seconds) * NS + since.microseconds * 1000)
    raise ValueError(text)


def text_of(data: bytes, name: str) -> str:
    """A table's text.

    Raises
    ------
    RecordingError : it is none.
    """
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        # a spreadsheet's "Unicode text"; what was read of it may end within a letter
        text = data.decode("utf-16", "replace")
    elif data.count(b"\0") > MOST_NUL * len(data):
        raise RecordingError(f"{name} is no text", "give a table as text")
    else:
        # a logger that was switched off, or opened its file before it wrote
        data = data.replace(b"\0", b"")
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            # a spreadsheet's "m/s²" and "µs"
            text = data.decode("cp1252", "replace")
    if "\n" not in text:
        text = text.replace("\r", "\n")
    return MONITORED.sub("", text) if MONITORED.match(text) else text


def table_of(text: str, name: str, said: Sequence[str | int] = (), bare: bool = False) -> TextTable | None:
    """The table in a text; None where no line names an accelerometer's or a gyroscope's columns.

    Parameters
    ----------
    said : the columns' names, of which the header has some, or their places, at which the first sample has numbers.
    bare : take the first line with the names x, y, z for the header.
    """
    begun = text.split("\n", PREAMBLE)[:PREAMBLE]
    names, places = {of for of in said if isinstance(of, str)}, [of for of in said if isinstance(of, int)]
    above = ""
    for number, line in enumerate(begun):
        for separator in SEPARATORS:
            cells = _below(above, line, separator)
            plain = {cell.strip() for cell in cells}
            if names:
                found = len(cells) >= len(said) and bool(
                    names & (plain | {of.partition("(")[0].strip() for of in plain})
                )
            elif places:
                found = len(cells) > max(places) and all(_is_number(cells[place]) for place in places)
            elif bare:
                found = {axis[0] for cell in cells if (axis := bare_axis(cell))} == {0, 1, 2}
            else:
                found = len({c.axis for c in columns_of(cells) if c.quantity in ("acc", "gyr")}) == 3
            if found and places and not names:
                before = _cells(begun[number - 1], separator) if number else []
                return _read(text, name, before if len(before) == len(cells) else [], number, separator)
            if found:
                return _read(text, name, cells, number + 1, separator)
        above = line
    return table_of(text, name, range(len(said))) if names else None


def _below(above: str, line: str, separator: str | None) -> list[str]:
    """The cells of a line; of two lines of names, of which the first has a sensor's and the second its axes, both."""
    cells, sensors = _cells(line, separator), _cells(above, separator)
    axes = [cell.strip().lower() for cell in cells]
    if separator is None or len(sensors) != len(cells) or not {"x", "y", "z"} <= set(axes) or not any(sensors):
        return cells
    of, found = "", []
    for sensor, axis in zip(sensors, cells, strict=True):
        of = sensor.strip() or of
        found.append(f"{of} {axis.strip()}")
    return found


def numeric_table(text: str, name: str, least: int) -> TextTable | None:
    """The table whose lines are `least` numbers or more, whatever its header; None where there is none."""
    begun = text.split("\n", PREAMBLE)[:PREAMBLE]
    for first, (line, following) in enumerate(pairwise(begun)):
        for separator in SEPARATORS:
            cells, more = _cells(line, separator), _cells(following, separator)
            if len(cells) >= least and len(more) == len(cells) and all(map(_is_number, (*cells, *more))):
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


def _is_number(cell: str) -> bool:
    try:
        _exact(cell)
    except ValueError:
        return False
    return True


def _read(text: str, name: str, header: list[str], first: int, separator: str | None) -> TextTable:
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
            # a logger that was started again writes its header again
            if any(map(str.strip, row)) and not row[0].startswith(COMMENT) and row != header:
                rows.append(row)
                lines.append(line)
    except csv.Error as error:
        raise RecordingError(f"{name} is no table ({error})", "give a table as text") from error
    torn = [lines[-1]] if len(rows) > 1 and not text.endswith("\n") and len(rows[-1]) < len(rows[-2]) else []
    if torn:
        # a logger that was switched off
        rows, lines = rows[:-1], lines[:-1]
    if rows and _are_units(rows[0]):
        header = [
            f"{of} ({unit.strip()})" if unit.strip() else of for of, unit in zip_longest(header, rows[0], fillvalue="")
        ]
        rows, lines = rows[1:], lines[1:]
    return TextTable(name, header, rows, lines, separator, torn)


def _are_units(cells: list[str]) -> bool:
    """Whether a line below the header says the units."""
    return any(map(unit_named, cells)) and not any(_is_number(cell) for cell in cells)
