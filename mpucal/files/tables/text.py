"""Tables as text: the encoding, the separator, the lines before the header, and the times before each line."""

from __future__ import annotations

import csv
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Sequence
from io import StringIO
from itertools import chain, zip_longest
from pathlib import Path

import numpy as np

from ...errors import RecordingError
from ..reading import check_size, is_text
from .cells import CLOCK, MOMENT, NUMBER, is_number
from .names import ACC, GYR, LONGEST_NAME, axes_of, parse_axis_name, parse_header
from .table import IS_LIST, Table, axes_of_lists, holds_number, with_lists_apart, with_units_of_cells
from .units import find_unit

# separator -> its name for messages; None: any blanks
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", None: "blanks"}
# lines that may precede the header: a sketch's greeting, `sep=;`, the settings that Betaflight's Explorer writes
PREAMBLE = 200
# lines below the header that hold no numbers
MORE_HEADS = 3
# characters within which the names of columns begin
HEAD = 4096
# a header may begin with such a mark; any other line that does is a comment
COMMENT = ("#", "%", "//")
# names within quotation marks may span lines
_QUOTED = re.compile(r'"[^"]*"')
# Serial monitors, terminals and loggers write the time before each line: `12:03:04.123 -> `, `[2024-05-01 12:03:04] `,
# `2024-05-01 12:03:04,123 - INFO - `. A blank alone ends it where the line goes on with numbers and another separator.
MONITORED = re.compile(
    rf"^\[?(?:(\d{{4}}-\d\d-\d\d)[ T])?({CLOCK})Z?"
    r"(?:[ \t]{1,3}(?:- )?[\[<]?(?:DEBUG|INFO|WARNING|ERROR)[\]>:]*(?: -)?[ \t]{1,3}(?=[-+.\d])"
    r"|\][ \t]*|[ \t]*-?>[ \t]*|[ \t]+(?=[-+.\d][^\n ]*[,;\t]))",
    re.MULTILINE,
)
# colours of a terminal, and the checksums of sentences as of NMEA 0183
_MARKS = re.compile(r"\x1b\[[0-9;]{0,9}m|\*[0-9A-F]{2}(?=\r?$)", re.MULTILINE)
# of Fortran's double precision
_EXPONENT = re.compile(r"(?<=\d)D(?=[-+]\d\d)")
_NUMBER_OR_MOMENT = re.compile(rf"(?<![\w.])(?:{MOMENT}|{NUMBER})(?!\w)")

# above a table without times, as `Fs,100`, `Sample rate: 52 Hz` or `# Config: data_rate = 2000.0 Hz, filter = ...`
RATE = re.compile(
    r"(?:^[#%/ ]{0,5}|(?<![a-z])(?:sampl(?:e|ing)|data|output|acquisition|update|sensor|imu|log(?:ging)?|recording))"
    r"[ _]?"
    r"(?:(?<![a-z])fs|rate|freq\w{0,6})[^\w\n]{1,9}(?:\(?Hz\)?[^\w\n]{1,9})?"
    r"([1-9]\d{0,4}(?:\.\d{1,17})?)[ ,]*(?:Hz|$)",
    re.IGNORECASE | re.MULTILINE,
)

Cells = list[str]


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
        # objects of JSON may be one after the other
        text = text.replace("\r", "\n").replace("}{", "}\n{")
    head = _QUOTED.sub(lambda q: q[0].replace("\n", " ") if len(q[0]) <= LONGEST_NAME + 2 else q[0], text[:HEAD])
    text = _EXPONENT.sub("E", _MARKS.sub("", head + text[HEAD:]))
    # the part of the file that was read may end within a line
    begun = text[:HEAD].rpartition("\n")[0] or text
    stamped = [*MONITORED.finditer(begun)]
    if 2 * len(stamped) <= begun.count("\n"):
        return text
    rest = begun[stamped[-1].end() :].partition("\n")[0]
    separator = next((mark for mark in ",;\t" if mark in rest), " ")
    text = MONITORED.sub(lambda of: f"{f'{of[1]}T' if of[1] else ''}{of[2].replace(',', '.')}{separator}", text)
    return re.sub(rf"^[^\s,;]+{re.escape(separator)}\r?$", "", text, flags=re.MULTILINE)


def stated_rate_hz(text: str) -> float | None:
    """Return the sample rate that a text states; None if it states none."""
    found = RATE.search(text)
    return float(found[1]) if found else None


def find_wanted_table(text: str, name: str, wanted: Sequence[str | int]) -> Table | None:
    """Return the table in which a line names one of the `wanted` columns, or has numbers at those places."""
    names, places = {of for of in wanted if isinstance(of, str)}, [of for of in wanted if isinstance(of, int)]

    def names_some(cells: Cells) -> bool:
        plain = {cell.strip() for cell in cells}
        return len(cells) >= len(wanted) and bool(names & (plain | {of.partition("(")[0].strip() for of in plain}))

    def has_numbers(cells: Cells, _following: Cells) -> bool:
        at = places or [*range(len(wanted))]
        return len(cells) > max(at) and all(is_number(cells[place]) for place in at)

    found = _find(text, name, is_header=names_some) if names else None
    return found or _find(text, name, is_row=has_numbers) or find_numbers(text, name)


def find_named_table(text: str, name: str) -> Table | None:
    """Return the table in which a line names the columns of an accelerometer or a gyroscope."""
    sensors = (ACC, GYR)
    return _find(text, name, lambda cells: len({c.axis for c in parse_header(cells) if c.quantity in sensors}) == 3)


def find_bare_table(text: str, name: str) -> Table | None:
    """Return the table in which a line names x, y and z, or of lines of numbers with any header or none."""
    named = _find(text, name, lambda cells: {axis[0] for cell in cells if (axis := parse_axis_name(cell))} == {0, 1, 2})
    return named or _find(text, name, is_row=_are_numbers) or find_numbers(text, name)


def _are_numbers(cells: Cells, following: Cells) -> bool:
    """Return True if two lines hold three numbers or more at the same places.

    Among fewer numbers than those of both sensors, other cells are a mark that each line repeats, or name a sensor.
    """
    measured = [[is_number(cell) or IS_LIST(cell) is not None for cell in of] for of in (cells, following)]
    alike = [one and other for one, other in zip(*measured, strict=False)]
    words = (two for *two, number in zip(cells, following, alike, strict=False) if not number)
    marked = all(one == other or axes_of(one) or parse_header([one]) for one, other in words)
    return sum(alike) >= len("xyz") * (1 if marked else 2) and len(following) == len(cells)


def _find(
    text: str,
    name: str,
    is_header: Callable[[Cells], bool] | None = None,
    is_row: Callable[[Cells, Cells], bool] | None = None,
) -> Table | None:
    """Return the table below the first line that is a header, or from the first row on, below a header as wide."""
    begun = ["", *text.split("\n", PREAMBLE + 1)[: PREAMBLE + 1], ""]
    for number in range(min(len(begun) - 2, PREAMBLE)):
        above, line, following = begun[number : number + 3]
        for separator in SEPARATORS:
            cells, below = _split(line, separator), _split(following, separator)
            if is_header is not None:
                cells = _with_line_above(_split(above, separator), cells) if separator else cells
                # a name may hold blanks
                names = _with_axes(cells, below)
                if (separator or not below or len(below) - len(cells) in (0, 1)) and is_header(names):
                    return read_table(text, name, cells, number + 1, separator)
            elif is_row is not None and is_row(cells, below):
                header = _split(above, separator)
                return read_table(text, name, header if len(header) == len(cells) else [], number, separator)
    return None


def _with_axes(header: Cells, below: Cells) -> Cells:
    """Return a header with three names in place of a sensor's, if the cell below it lists three numbers."""
    axes = axes_of_lists(header, below) if len(header) == len(below) else []
    return [*chain(*(of or [name] for of, name in zip(axes, header, strict=True)))] if any(axes) else header


def _with_line_above(sensors: Cells, axes: Cells) -> Cells:
    """Return a header whose axes are called after the sensors in the line above, if that names them."""
    if len(sensors) != len(axes) or not {"x", "y", "z"} <= {cell.strip().lower() for cell in axes} or not any(sensors):
        return axes
    of, found = "", []
    for sensor, axis in zip(sensors, axes, strict=True):
        of = sensor.strip() or of
        found.append(f"{of} {axis.strip()}")
    return found


def _split(line: str, separator: str | None) -> Cells:
    """Return the cells of a line; none if it lacks the separator."""
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


def find_numbers(text: str, name: str) -> Table | None:
    """Return the table of the numbers and times in lines that hold equally many, six or more; None if there is none."""
    found = [(i, _NUMBER_OR_MOMENT.findall(line)) for i, line in enumerate(text.split("\n"), 1)]
    found = [(i, cells) for i, cells in found if len(cells) >= 2 * len("xyz")]
    widths = [len(cells) for _, cells in found[:PREAMBLE]]
    width = max(set(widths), key=widths.count, default=0)
    rows = [cells if len(cells) == width else [] for _, cells in found]
    return table_of_rows(name, [], rows, [i for i, _ in found]) if len(rows) > 1 and rows[0] else None


def table_of_rows(name: str, header: Cells, rows: list[Cells], lines: list[int], *remarks: str) -> Table:
    """Return the table of the cells of each line; none of a line that was torn.

    A line may have one cell more than names: the first is then an index, or the last if only that counts the lines.
    """
    width = int(np.median([len(row) for row in rows])) if rows else 0
    whole = [row for row in rows if len(row) == width]
    if header and width == len(header) + 1 and any(row[-1].strip() for row in whole):
        counts = [_counts([row[place] for row in whole]) for place in (0, -1)]
        header = [*header, ""] if counts == [False, True] else ["", *header]
    width = len(header) or width
    columns = [[*cells] for cells in zip_longest(*(row[:width] for row in rows), [""] * width, fillvalue="")]
    return Table(name, header, [cells[:-1] for cells in columns], lines, remarks=remarks)


def _counts(cells: Cells) -> bool:
    """Return True if cells are whole numbers, of which most are by 1 more than the one before."""
    numbers = [int(cell) for cell in cells if cell.strip().isdecimal()]
    return len(numbers) == len(cells) and 2 * int(np.count_nonzero(np.diff(numbers) == 1)) > len(numbers)


def read_table(text: str, name: str, header: Cells, first: int, separator: str | None) -> Table:
    """Return the table below the first `first` lines."""
    # In CPython on 64 bits a line takes at least a list (56 bytes), its reference and line number (16 and 32), and a
    # Decimal of its time (104 and 8); a cell takes two references and a float64.
    check_size(Path(name), text.count("\n") * (216 + 24 * len(header)))
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
    while header and rows and not any(map(holds_number, rows[0])) and lines[0] <= first + MORE_HEADS:
        # units, the name of pandas' index, or what a program says of each column
        more = [cell.strip(" ()[]") for cell in rows[0]]
        has_units, pairs = any(map(find_unit, more)), zip_longest(header, more, fillvalue="")
        header = [f"{of} ({cell})" if of and cell and has_units else of or cell for of, cell in pairs]
        rows, lines = rows[1:], lines[1:]
    remarks = [] if separator == "," else [f"its cells are separated by {SEPARATORS[separator]}"]
    table = table_of_rows(name, header, rows, lines, *remarks)
    return with_lists_apart(with_units_of_cells(table)) if table.header and rows else table
