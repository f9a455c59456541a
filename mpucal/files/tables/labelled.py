"""Lines that name each number or their sensor, as sketches and databases write them, or begin with a program's mark."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from itertools import chain

from .cells import MOMENT, NUMBER, Kind
from .guess import is_clock
from .names import (
    ACC,
    ENDINGS_OF_SENSORS,
    GYR,
    TIME,
    WITHOUT_GRAVITY,
    Column,
    axes_of,
    names_both,
    parse_axis_name,
    parse_column_name,
    parse_header,
)
from .several import FIRST_LINES, INSTANCE, MOST_SENSORS
from .table import Table
from .text import read_table, table_of_rows
from .units import find_unit

# a name of one or two words, `:` or `=`, and a number or a date; lengths are bounded: the search takes linear time
_NAME = r"(?<!\w)((?:[A-Za-z]{1,20} )?[A-Za-z_]\w{0,40})"
_PAIR = re.compile(rf"{_NAME}\s?[:=][ \t]{{0,9}}(?:({MOMENT})|({NUMBER}))(?![\w:])")
# programs' ways to write the time of a line, beside a date at its beginning: logs of ESP-IDF and of kernels, Teleplot,
# InfluxDB
_AT = "line_time="
_TIMES = (
    (re.compile(rf"^(?:[\w-]{{1,12}} ){{0,3}}({MOMENT})\b:?", re.MULTILINE), rf"{_AT}\1 "),
    (re.compile(r"^[EWIDV] \((\d{1,12})\) ", re.MULTILINE), rf"{_AT}\1, "),
    (re.compile(r"^\[ {0,9}(\d{1,9}\.\d{1,9})\] ", re.MULTILINE), rf"{_AT}\1, "),
    (re.compile(r"^>([A-Za-z_]\w{0,40}):(\d{10,19}):", re.MULTILINE), rf"{_AT}\2, \1:"),
    (re.compile(r"(?<=\d)[ \t](\d{10,19})\r?$", re.MULTILINE), rf", {_AT}\1"),
)
_QUOTES = dict.fromkeys(map(ord, "{}'\""))
# three axes at once, below their sensor or beside it: `accel=(9252, -5612, -12084)`, `GYRO: X=0.1,Y=0.2,Z=0.3`,
# `Accel  x 0.1  y 0.2  z 9.8`, `Gyro [dps]: 0.6 -0.8 -0.2`, `Angular Velocity: (0.1, 0.2, 0.3)`
_AXES = (rf"(?:{axis}[ \t]{{0,9}}[:=]?[ \t]{{0,9}})?({NUMBER}|nan)" for axis in ("[Xx]", "[Yy]", "[Zz]"))
_THREE = re.compile(
    r"(?<![\w.])((?:[A-Za-z]{1,20} )?[A-Za-z_]\w{0,40})[ \t]{0,9}(?:[(\[]([^\d()\[\],;\s][^()\[\],;\s]{0,11})[)\]])?"
    + r"[ \t]{0,9}[:=]?\s{0,3}[(\[]?[ \t]{0,9}"
    + r"(?:[ \t]{0,9}[,;|][ \t]{0,9}|[ \t]{1,9})".join(_AXES)
    + r"(?![\w.])(?![ \t]{0,9}[,;|]?[ \t]{0,9}[-+.\d])"
)
# unit -> how a name ends that has it: the first of those that are read
_ENDINGS = {find_unit(ending): f"_{ending}" for ending in reversed(ENDINGS_OF_SENSORS.split())}
# as `rostopic echo` and `ros2 topic echo` print messages
_BETWEEN_RECORDS = "\n---\n"
VALUE = "value"


@dataclass(frozen=True)
class Marked:
    """Lines of a program that begin with a mark: their pattern, with the numbers as its group, and their columns."""

    pattern: str
    columns: str
    ranges: tuple[float, float] | None = None


MARKED = (
    # i2cdevlib's MPU6050_raw and MPU9150_raw; MPU6050::initialize() sets these ranges
    Marked(
        r"^[^\n]{0,40}?a/g(?:/m)?:((?:[ \t]+-?[0-9]{1,6}){6})(?:[ \t]+-?[0-9]{1,6}){0,3}[ \t\r]*$",
        "ax(lsb) ay(lsb) az(lsb) gx(lsb) gy(lsb) gz(lsb)",
        (2.0, 250.0),
    ),
    # VectorNav's VN-100 to VN-300, whose checksums are left out
    Marked(
        r"^\$VNIMU((?:,[-+0-9.]{1,20}){11})[ \t\r]*$",
        "mx my mz ax(m/s^2) ay(m/s^2) az(m/s^2) gx(rad/s) gy(rad/s) gz(rad/s) temperature_c pressure",
    ),
    Marked(
        r"^\$VNYMR((?:,[-+0-9.]{1,20}){12})[ \t\r]*$",
        "yaw pitch roll mx my mz ax(m/s^2) ay(m/s^2) az(m/s^2) gx(rad/s) gy(rad/s) gz(rad/s)",
    ),
)


def marked_table(text: str, name: str) -> Table | None:
    """Return the table in lines that begin with a program's mark; None if there are none."""
    for each in MARKED:
        whole = text if text.endswith("\n") else text[: text.rfind("\n") + 1]
        rows = [line.replace(",", " ").split() for line in re.findall(each.pattern, whole, re.MULTILINE)]
        if rows:
            found = table_of_rows(name, each.columns.split(), rows, [*range(1, len(rows) + 1)])
            return replace(found, ranges=each.ranges)
    return None


def dataflash_text_table(text: str, name: str) -> Table | None:
    """Return the table in an ArduPilot log as text, whose FMT line names the columns; None for other text."""
    named = re.search(r"^FMT, ?\d+, ?\d+, ?IMU, ?\w+, ?([\w,]+)\r?$", text, re.MULTILINE)
    lines = re.findall(r"^IMU, ?(.+)\n", text, re.MULTILINE)
    header = [INSTANCE.get(label, label) for label in named[1].split(",")] if named else []
    return read_table("\n".join(lines), name, header, 0, ",") if named and lines else None


def labelled_table(text: str, name: str) -> Table | None:
    """Return the table in lines that name each number, without the text between; None if none name all six axes.

    A sample is a line, or the lines from one that names the first axis to the next such line.
    """
    first_lines = _label("\n".join(text.split("\n", FIRST_LINES)[:FIRST_LINES]))
    begun = dict.fromkeys(tuple(_numbers(line)) for line in first_lines)
    together = tuple(dict.fromkeys(name for names in begun for name in names))
    header = next((names for names in begun if names_both(parse_header(names))), together)
    if not names_both(parse_header(header)):
        return None
    columns = parse_header(header)
    measured = [header[c.place] for c in columns if c.quantity in (ACC, GYR)]
    needed = {*measured, *(header[c.place] for c in columns if c.quantity == TIME)}
    part = re.compile(rf"(?<!\w)({'|'.join(map(re.escape, measured))})\s?[:=]")
    lines: list[int] = []
    records: list[dict[str, str]] = []
    named: set[str] = set()
    for i, line in enumerate(_label(text), 1):
        there = set(part.findall(line))
        if there and (header is not together or measured[0] in there or there & named):
            records.append({})
            lines.append(i)
            named = set()
        if records:
            records[-1] = _numbers(line) | records[-1]
            named |= there
    rows = [[found.get(of, "") for of in header] if needed <= found.keys() else [] for found in records]
    return table_of_rows(name, [*header], rows, lines)


def _label(text: str) -> list[str]:
    """Return the lines of a text with `NAME=` before each number whose name stands elsewhere."""
    text = _join_records(text) if _BETWEEN_RECORDS in text else text
    text = text.translate(_QUOTES)
    for pattern, replacement in _TIMES:
        text = pattern.sub(replacement, text)
    return _THREE.sub(_name_axes, text).split("\n")


def _join_records(text: str) -> str:
    """Return a line for each record of YAML, with `stamp_secs=..` for `secs` below `stamp`."""
    lines = []
    for record in text.split(_BETWEEN_RECORDS):
        of, cells = "", []
        for line in record.split("\n"):
            key, _, value = line.partition(":")
            if value.strip():
                cells.append(f"{of}_{key.strip()}={value.strip()}" if key[:1].isspace() else line)
            else:
                of = key.strip()
        lines.append(", ".join(cells))
    return "\n".join(lines)


def _name_axes(found: re.Match[str]) -> str:
    """Return `NAME_x_UNIT=..., NAME_y_UNIT=...` and so on of a sensor's three numbers; other words as they are."""
    unit = _ENDINGS.get(find_unit(found[2] or ""), "")
    # of two words, the first may be another's: RAW accel
    axes = axes_of(found[1]) or axes_of(found[1].split()[-1])
    named = zip(axes, found.groups()[2:], strict=False)
    return ", ".join(f"{axis}{unit}={cell}" for axis, cell in named) or found[0]


def _numbers(line: str) -> dict[str, str]:
    """Return name -> number or date of a line."""
    found = ((name, date or number) for name, date, number in _PAIR.findall(line))
    return {name if parse_column_name(name, 0) else name.split()[-1]: number for name, number in found}


def pivot(table: Table) -> Table | None:
    """Return a table whose lines name their sensor, or their axis, with a column for each axis; None for others.

    Lines of one time are a sample.
    """
    for place in table.places(Kind.WORD):
        words = [word for word in dict.fromkeys(table.cells[place]) if word][:MOST_SENSORS]
        # linear_acceleration.x is ROS's, which contains gravity
        names = {word: [word] for word in words if parse_header([word])}
        names |= {word: axes_of(word) for word in words if word not in names and not WITHOUT_GRAVITY.match(word)}
        if names_both(parse_header([*chain(*names.values())])):
            break
    else:
        return None
    numbers = {at: table.numbers([Column("", at, "")])[:, 0] for at in table.places(Kind.NUMBER)}
    increasing = [Column(TIME, at, TIME) for at, of in numbers.items() if is_clock(of)]
    clocks = sorted(table.clocks(table.columns) or increasing, key=lambda clock: clock.rank)
    free = [at for at in numbers if at not in {clock.place for clock in (*clocks, *increasing)}]
    axes = {at: axis for at in free if (axis := parse_axis_name(table.name_of(at)))}
    called = sorted(axes, key=axes.__getitem__) or [at for at in free if table.name_of(at).strip("_").lower() == VALUE]
    if not clocks or not free:
        return None
    records: dict[str, list[dict[str, str]]] = {}
    for time, word, *row in zip(*(table.cells[at] for at in (clocks[0].place, place, *(called or free))), strict=True):
        if word in names:
            found = dict(zip(names[word], map(str, row), strict=False))
            # a second sample at one time is another one
            at_once = records.setdefault(time, [])
            record = next((each for each in at_once if not found.keys() & each.keys()), None)
            at_once.append(found) if record is None else record.update(found)
    header = list(dict.fromkeys(chain(*names.values())))
    rows = [
        [str(time), *(each.get(name, "") for name in header)] for time, at_once in records.items() for each in at_once
    ]
    made = table_of_rows(table.name, [clocks[0].name or TIME, *header], rows, [*range(1, len(rows) + 1)])
    return replace(made, remarks=table.remarks).noted("its lines of one time were joined")
