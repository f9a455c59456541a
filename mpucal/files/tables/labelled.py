"""Lines that name each number, as sketches print for Arduino's serial plotter, or that begin with a program's mark."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import chain

from .cells import MOMENT, NUMBER
from .names import ACC, GYR, TIME, first_triple, parse_column_name, parse_header
from .text import PREAMBLE, TextTable

# a name of one or two words, `:` or `=`, and a number or a date; lengths are bounded: the search takes linear time
_NAME = r"(?<!\w)((?:[A-Za-z]{1,20} )?[A-Za-z_]\w{0,40})"
_PAIR = re.compile(rf"{_NAME}\s?[:=][ \t]{{0,9}}(?:({MOMENT})|({NUMBER}))(?![\w:])")
# programs' ways to write the time of a line, beside a date at its beginning: ESP-IDF's log, Teleplot, InfluxDB
_AT = "line_time="
_TIMES = (
    (re.compile(rf"^(?:[\w-]{{1,12}} ){{0,3}}(?={MOMENT}\b)", re.MULTILINE), _AT),
    (re.compile(r"^[EWIDV] \((\d{1,12})\) ", re.MULTILINE), rf"{_AT}\1, "),
    (re.compile(r"^>([A-Za-z_]\w{0,40}):(\d{10,19}):", re.MULTILINE), rf"{_AT}\2, \1:"),
    (re.compile(r"(?<=\d)[ \t](\d{10,19})\r?$", re.MULTILINE), rf", {_AT}\1"),
)
_NAMED = re.compile(r"[\w'\"][ \t]{0,9}=|[A-Za-z_'\"][ \t]{0,9}:")
_QUOTES = dict.fromkeys(map(ord, "{}'\""))
# three axes at once: `accel=(9252, -5612, -12084)`, `GYRO: X=0.1,Y=0.2,Z=0.3`, `Acceleration X: 0.1, Y: 0.2, Z: 0.3`
_CELL = r"([^,()\[\]\n\t=:]{1,30})"
_THREE = re.compile(
    rf"(?<!\w)([A-Za-z_]\w{{0,40}})\s?(?:[:=]\s?[(\[]{_CELL},{_CELL},{_CELL}[)\]]"
    rf"|[:=]?[ \t]{{0,9}}[Xx][:=]{_CELL}[,\t]\s?[Yy][:=]{_CELL}[,\t]\s?[Zz][:=](?=[\s\d.+-]))"
)
# as `rostopic echo` and `ros2 topic echo` print messages
_BETWEEN_RECORDS = "\n---\n"


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
    # VectorNav's VN-100 to VN-300
    Marked(
        r"^\$VNIMU((?:,[-+0-9.]{1,20}){11})\*",
        "mx my mz ax(m/s^2) ay(m/s^2) az(m/s^2) gx(rad/s) gy(rad/s) gz(rad/s) temperature_c pressure",
    ),
    Marked(
        r"^\$VNYMR((?:,[-+0-9.]{1,20}){12})\*",
        "yaw pitch roll mx my mz ax(m/s^2) ay(m/s^2) az(m/s^2) gx(rad/s) gy(rad/s) gz(rad/s)",
    ),
)


def marked_table(text: str, name: str) -> TextTable | None:
    """Return the table in lines that begin with a program's mark; None if there are none."""
    for each in MARKED:
        whole = text if text.endswith("\n") else text[: text.rfind("\n") + 1]
        found = re.findall(each.pattern, whole, re.MULTILINE)
        if found:
            rows = [line.replace(",", " ").split() for line in found]
            return TextTable(name, each.columns.split(), rows, [*range(1, len(rows) + 1)], ":", each.ranges)
    return None


def labelled_table(text: str, name: str) -> TextTable | None:
    """Return the table in lines that name each number, without the text between; None if none name all six axes.

    A sample is a line, or the lines from one that names the first axis to the next such line.
    """
    if not _NAMED.search(text):
        return None
    text = _join_records(text) if _BETWEEN_RECORDS in text else text
    text = text.translate(_QUOTES)
    for pattern, replacement in _TIMES:
        text = pattern.sub(replacement, text)
    text, threes = _THREE.subn(_name_axes, text)
    # in a log that names three axes at once, the first such line may come late
    begun = [list(_numbers(line)) for line in text.split("\n")[: None if threes > PREAMBLE else PREAMBLE]]
    together = list(dict.fromkeys(chain(*begun)))
    header = next((names for names in begun if _names_both(names)), together)
    if not _names_both(header):
        return None
    columns = parse_header(header)
    measured = [header[c.place] for c in columns if c.quantity in (ACC, GYR)]
    needed = {*measured, *(header[c.place] for c in columns if c.quantity == TIME)}
    part = re.compile(rf"(?<!\w)({'|'.join(map(re.escape, measured))})\s?[:=]")
    lines: list[int] = []
    records: list[dict[str, str]] = []
    named: set[str] = set()
    for i, line in enumerate(text.split("\n"), 1):
        there = set(part.findall(line))
        if there and (header is not together or measured[0] in there or there & named):
            records.append({})
            lines.append(i)
            named = set()
        if records:
            records[-1] = _numbers(line) | records[-1]
            named |= there
    rows = [[found.get(of, "") for of in header] if needed <= found.keys() else [] for found in records]
    return TextTable(name, header, rows, lines, ":")


def _names_both(names: list[str]) -> bool:
    columns = parse_header(names)
    return bool(first_triple(columns, ACC) and first_triple(columns, GYR))


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
    """Return `NAME_x=..., NAME_y=..., NAME_z=` of three axes at once."""
    of, *cells = filter(None, found.groups())
    cells = [*cells, ""][:3]
    return ", ".join(f"{of}_{axis}={cell}" for axis, cell in zip("xyz", cells, strict=True))


def _numbers(line: str) -> dict[str, str]:
    """Return name -> number or date of a line."""
    found = ((name, date or number) for name, date, number in _PAIR.findall(line))
    return {name if parse_column_name(name, 0) else name.split()[-1]: number for name, number in found}
