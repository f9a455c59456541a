"""Tables as text: the separator, decimal commas, what stands before the header, and cells as exact numbers."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal, InvalidOperation
from io import StringIO

import numpy as np

from ...data import Vector
from ...errors import RecordingError
from .names import Column, columns_of

# and what they are called; None: any blanks
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", None: "blanks"}
# lines before the header: what a sketch says at its start, `sep=;`
PREAMBLE = 40
NS = 1_000_000_000
# of a time, as nobody has more
DIGITS = 40


@dataclass(frozen=True)
class TextTable:
    """Cells of a table.

    Attributes
    ----------
    header : the columns' names; empty where there are none. rows : the cells of each line that has some.
    lines : the number of each, from 1. separator : one of SEPARATORS, between cells.
    """

    name: str
    header: list[str]
    rows: list[list[str]]
    lines: list[int]
    separator: str | None = ","

    @property
    def columns(self) -> list[Column]:
        """What is known of its columns."""
        return columns_of(self.header)

    def has(self, column: Column) -> bool:
        """Whether the first line of a column holds a number or a date."""
        try:
            _exact(self.rows[0][column.place])
        except (IndexError, ValueError):
            return False
        return True

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
        """(n,) exact times; dates in ns since 1970.

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
        """Whether its times are dates."""
        return "-" in self.rows[0][column.place].strip()[1:] and "e-" not in self.rows[0][column.place].lower()

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


def _point(text: str) -> str:
    return text.replace(",", ".") if "," in text and "." not in text else text


def _exact(text: str) -> Decimal:
    """A number, or a date in ns since 1970."""
    text = text.strip()
    try:
        number = Decimal(_point(text))
        if number.is_finite() and abs(number.adjusted()) < DIGITS:
            return number
    except InvalidOperation:
        date = datetime.fromisoformat(text)
        seconds = int(date.replace(microsecond=0).timestamp())
        return Decimal(seconds * NS + date.microsecond * 1000)
    raise ValueError(text)


def text_of(data: bytes, name: str) -> str:
    """A table's text.

    Raises
    ------
    RecordingError : it is none.
    """
    if b"\0" in data:
        raise RecordingError(f"{name} is no text", "give a table as text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # a spreadsheet's "m/s²" and "µs"
        return data.decode("cp1252", "replace")


def table_of(text: str, name: str, headless: bool = False, bare: bool = False) -> TextTable | None:
    """The table in a text; None where no line names an accelerometer's or a gyroscope's columns.

    Parameters
    ----------
    headless : take the first line whose cells are numbers for the first sample, and one before it for the header.
    bare : take the first line with the names x, y, z for the header.
    """
    begun = text.split("\n", PREAMBLE)[:PREAMBLE]
    for number, line in enumerate(begun):
        for separator in SEPARATORS:
            cells = _cells(line, separator)
            if headless:
                found = len(cells) > 5 and _is_row(cells)
            elif bare:
                found = {"x", "y", "z"} <= {cell.strip().lower() for cell in cells}
            else:
                found = len({c.axis for c in columns_of(cells) if c.quantity in ("acc", "gyr")}) == 3
            if found:
                header = cells
                first = number + 1
                if headless:
                    before = _cells(begun[number - 1], separator) if number else []
                    header, first = (before if len(before) == len(cells) else []), number
                return _read(text, name, header, first, separator)
    return None


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    if separator not in line:
        return []
    try:
        return next(csv.reader([line.rstrip("\r\n")], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:
        return []


def _is_row(cells: list[str]) -> bool:
    try:
        for cell in cells:
            float(_point(cell.strip()))
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
            if any(map(str.strip, row)):
                rows.append(row)
                lines.append(line)
    except csv.Error as error:
        raise RecordingError(f"{name} is no table ({error})", "give a table as text") from error
    return TextTable(name, header, rows, lines, separator)
