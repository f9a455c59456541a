"""Tables as text: the separator, decimal commas, the lines before the header, and cells as exact numbers."""

from __future__ import annotations

import csv
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from io import StringIO
from itertools import pairwise, zip_longest
from pathlib import Path

import numpy as np

from ...data import Mask, Vector
from ...errors import RecordingError
from ..reading import MOST_ODD, check_size, is_text
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
# exponents of numbers beyond this would take all memory as integers
MOST_DIGITS = 40
# units of a column beside whole seconds
BELOW_A_SECOND = ("ms", "us", "ns")
# names within quotation marks may span lines
_QUOTED = re.compile(r'"[^"]{0,60}"')
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
DAY_NS = 86400 * NS
CLOCK = r"\d\d?:\d\d:\d\d(?:[.,]\d{1,9})?"
# Serial monitors, terminals and loggers write the time before each line: `12:03:04.123 -> `, `[2024-05-01 12:03:04] `.
# A blank alone ends it where the line goes on with numbers and another separator.
MONITORED = re.compile(
    rf"^\[?(?:(\d{{4}}-\d\d-\d\d)[ T])?({CLOCK})Z?"
    r"(?:\][ \t]*|[ \t]*-?>[ \t]*|[ \t]+(?=[-+.\d][^\n ]*[,;\t]))",
    re.MULTILINE,
)
COLOUR = re.compile(r"\x1b\[[0-9;]{0,9}m")
# the hours may be missing; days are those of pandas' durations, and milliseconds may follow a colon
_TIME_OF_DAY = re.compile(
    r"(?:(\d{1,6}) days? )?(?:(\d\d?):)?(\d\d):(\d\d)((?:\.|(?<=\d:\d\d:\d\d):)\d+)?(?: ?([AaPp])\.?[Mm]\.?)?"
).fullmatch
# a date that does not begin with the year, or not as ISO 8601 has it, and a time of day
_DATE = re.compile(r"(\d{1,4})([./-])(\d{1,2}|[A-Za-z]{3})\2(\d{1,4}),?[ T]+(\S.*)").fullmatch
_ISO = re.compile(r"\d{4}-\d\d-\d\d").match
_MONTHS = "janfebmaraprmayjunjulaugsepoctnovdec"
# a number and its unit in one cell
_WITH_UNIT = re.compile(r"[-+.\d][-+.,\deE]*( ?[^-+.,\d\s][^\d]{0,9}\d?)").fullmatch
# among other text; lengths are bounded: the search takes linear time
NUMBER = r"[-+]?(?:\d{1,20}\.?\d{0,20}|\.\d{1,20})(?:[eE][-+]?\d{1,3})?"
MOMENT = rf"(?:\d{{4}}-\d\d-\d\d[ T])?{CLOCK}(?:Z|[+-]\d\d:?\d\d)?"
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
        return [place for place, cell in enumerate(self.rows[0][:width]) if _is_number(cell, dates=False)]

    def clocks(self, columns: Sequence[Column]) -> list[Column]:
        """See Table; if none is named, the first column of dates or times of day that changes."""
        # the last of them may be torn
        some = self.rows[:: max(len(self.rows) // LOOKED_AT, 1)][: LOOKED_AT + 1] or self.rows
        cells = [(c, [row[c.place] for row in some if c.place < len(row)]) for c in columns if c.quantity == TIME]
        # a few cells may be damaged
        named = [c for c, of in cells if of and np.mean([*map(_is_number, filter(str.strip, of))] or 1) > 1 - MOST_ODD]
        for place, cell in enumerate([] if named else self.rows[0]):
            dates = {row[place] for row in some if place < len(row) and _is_number(row[place])}
            if len(dates) > 1 and _is_number(cell) and not _is_number(cell, dates=False):
                return [Column(self.header[place] if self.header else "", place, TIME)]
        return named

    def numbers(self, columns: Sequence[Column]) -> Vector:
        """See Table; a cell that a line lacks, or of a few damaged lines, is empty. The error names the line."""
        found, bad = np.full((len(self.rows), len(columns)), np.nan), []
        for j, column in enumerate(columns):
            for i, row in enumerate(self.rows):
                text = row[column.place].strip() if column.place < len(row) else ""
                try:
                    found[i, j] = float(_with_point(text)) if text else np.nan
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
            Decimal(_with_point(self._cell(int(kept.argmax()), column).strip()))
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
                at = _exact(text)
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


def _with_point(text: str) -> str:
    """Return a number's text with a decimal point in place of a comma."""
    return text.replace(",", ".") if "," in text and "." not in text else text


def _exact(text: str) -> Decimal:
    """Return a number, or a date's ns since 1970 (since the year 1 without a zone), or a time of day's ns."""
    text = text.strip()
    try:
        number = Decimal(_with_point(text))
        if number.is_finite() and abs(number.adjusted()) < MOST_DIGITS:
            return number
    except InvalidOperation:
        if of_day := _TIME_OF_DAY(_with_point(text)):
            days, hours, minutes, seconds, below, half = of_day.groups()
            hour = int(hours or 0) if half is None else int(hours or 0) % 12 + 12 * (half in "Pp")
            hour += 24 * int(days or 0)
            return ((hour * 60 + int(minutes)) * 60 + int(seconds) + Decimal(f"0.{(below or '.0')[1:]}")) * NS
        if (split := _DATE(text)) and not _ISO(text):
            return _days(split[1], split[3], split[4], split[2]) * DAY_NS + _exact(split[5])
        date = datetime.fromisoformat(re.sub(" (?:UTC|GMT)$", "Z", text))
        since = date - (EPOCH if date.tzinfo else datetime.min)
        return Decimal((since.days * 86400 + since.seconds) * NS + since.microseconds * 1000)
    raise ValueError(text)


def _days(first: str, middle: str, last: str, mark: str) -> int:
    """Return the days since the year 1 of 2024/5/1, 1.5.2024, 01-May-2024 or 5/1/2024, by the mark between them."""
    if len(first) == len("2024"):
        first, last = last, first
    month = _MONTHS.find(middle.lower()) // 3 + 1 if middle.isalpha() else int(middle)
    day = int(first)
    if month > 12 or (mark == "/" and day <= 12 and len(last) == len("2024")):
        day, month = month, day
    return datetime(int(last), month, day).toordinal() - 1


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
                found = len(cells) > max(places) and all(_is_number(cells[place]) for place in places)
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
            alike = [_is_number(one) and _is_number(other) for one, other in zip(cells, more, strict=False)]
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


def _is_number(cell: str, dates: bool = True) -> bool:
    """Return True if a cell holds a number, or a date or time of day if `dates`."""
    try:
        _exact(cell)
        return dates or Decimal(_with_point(cell.strip())).is_finite()
    except (ValueError, InvalidOperation):
        return False


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
    return any(map(find_unit, cells)) and not any(_is_number(cell) for cell in cells)
