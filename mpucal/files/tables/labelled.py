"""Lines that name each number, as sketches print for Arduino's serial plotter, or that begin with a program's mark."""

from __future__ import annotations

import re
from dataclasses import dataclass

from .names import ACC, GYR, TIME, first_triple, parse_column_name, parse_header
from .text import PREAMBLE, TextTable

# a name of one or two words, `:` or `=`, and a number or a date; lengths are bounded: the search takes linear time
_DATE = r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(?:\.\d{1,9})?"
_NAME, _NUMBER = (
    r"(?<!\w)((?:[A-Za-z]{1,20} )?[A-Za-z_]\w{0,40})",
    r"([-+]?(?:\d{1,20}\.?\d{0,20}|\.\d{1,20})(?:[eE][-+]?\d{1,3})?)",
)
_PAIR = re.compile(rf"{_NAME}\"?\s?[:=][ \t]{{0,9}}(?:({_DATE})|{_NUMBER})(?![\w:])")
_AT = re.compile(rf"^(?={_DATE}\b)", re.MULTILINE)
# three axes at once: `accel=(9252, -5612, -12084)`, `GYRO: X=0.1,Y=0.2,Z=0.3`, `Acceleration X: 0.1, Y: 0.2, Z: 0.3`
_CELL = r"([^,()\[\]\n=:]{1,30})"
_THREE = re.compile(
    rf"(?<!\w)([A-Za-z_]\w{{0,40}})\s?(?:[:=]\s?[(\[]{_CELL},{_CELL},{_CELL}[)\]]"
    rf"|[:=]?\s?X[:=]{_CELL},\s?Y[:=]{_CELL},\s?Z[:=](?=[\s\d.+-]))"
)
# as `rostopic echo` and `ros2 topic echo` print messages
_BETWEEN_RECORDS = "\n---\n"
# a line for each sensor, as in Adafruit's examples
_TWO_LINES = re.compile(r"^(Acceleration_x=[^\n]{1,90})\n(?=Rotation_x=)", re.MULTILINE)


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
    """Return the table in lines that name each number, without the text between; None if none names all six axes."""
    text = _join_records(text) if _BETWEEN_RECORDS in text else text
    text, threes = _THREE.subn(_name_axes, _AT.sub("time=", text))
    text = _TWO_LINES.sub(r"\1, ", text)
    # in a log that names three axes at once, the first such line may come late
    for line in text.split("\n")[: None if threes > PREAMBLE else PREAMBLE]:
        header = list(_numbers(line))
        columns = parse_header(header)
        if first_triple(columns, ACC) and first_triple(columns, GYR):
            measured = {header[c.place] for c in columns if c.quantity in (ACC, GYR)}
            part = re.compile(rf"(?<!\w)(?:{'|'.join(map(re.escape, measured))})\s?[:=]")
            read, rows, lines = [header[c.place] for c in columns if c.quantity == TIME], [], []
            for i, row in enumerate(text.split("\n"), 1):
                found = _numbers(row)
                whole = measured.union(read) <= found.keys()
                if whole or part.search(row):
                    rows.append([found.get(of, "") for of in header] if whole else [])
                    lines.append(i)
            return TextTable(name, header, rows, lines, ":")
    return None


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
