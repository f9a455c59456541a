"""Lines that name each number, as sketches print for Arduino's serial plotter: `AccelX:0.12,AccelY:...,GyroX:...`."""

from __future__ import annotations

import re

from .names import ACC, GYR, first_triple, parse_column_name, parse_header
from .text import PREAMBLE, TextTable

# in a log that names three axes at once, the first such line may come late
MOST_SEARCHED = 20_000
# a name of one or two words, `:` or `=`, and a number; lengths are bounded so that the search takes linear time
_NAME, _NUMBER = (
    r"(?<!\w)((?:[A-Za-z]{1,20} )?[A-Za-z_]\w{0,40})",
    r"([-+]?(?:\d{1,20}\.?\d{0,20}|\.\d{1,20})(?:[eE][-+]?\d{1,3})?)",
)
_PAIR = re.compile(rf"{_NAME}\s?[:=][ \t]{{0,9}}{_NUMBER}(?![\w:])")
# a line for each sensor, as in Adafruit's examples: `Acceleration X: 0.1, Y: ...` and `Rotation X: 0.2, Y: ...`
_AXES = re.compile(r"^(Acceleration|Rotation) X:([^,\n]{1,30}),[ ]?Y:([^,\n]{1,30}),[ ]?Z:", re.MULTILINE)
_TWO_LINES = re.compile(r"^(AccelerationX:[^\n]{1,90})\n(?=RotationX:)", re.MULTILINE)
# three axes at once, as in a log: `accel=(9252, -5612, -12084)`
_THREE = re.compile(
    r"(?<!\w)([A-Za-z_]\w{0,40})\s?[:=]\s?[(\[]([^,()\[\]\n]{1,30}),([^,()\[\]\n]{1,30}),([^,()\[\]\n]{1,30})[)\]]"
)


def labelled_table(text: str, name: str) -> TextTable | None:
    """Return the table in such lines, without the text between them; None if no line names all six axes."""
    text = _TWO_LINES.sub(r"\1, ", _AXES.sub(r"\1X:\2, \1Y:\3, \1Z:", text))
    text, threes = _THREE.subn(r"\1_x=\2, \1_y=\3, \1_z=\4", text)
    searched = MOST_SEARCHED if threes > PREAMBLE else PREAMBLE
    for line in text.split("\n", searched)[:searched]:
        header = _names(line)
        columns = parse_header(header)
        if first_triple(columns, ACC) and first_triple(columns, GYR):
            measured = [header[c.place] for c in columns if c.quantity in (ACC, GYR)]
            part = re.compile(rf"(?<!\w)({'|'.join(map(re.escape, measured))})\s?[:=]")
            rows, lines = [], []
            for i, row in enumerate(text.split("\n"), 1):
                whole = _names(row) == header
                if whole or part.search(row):
                    rows.append([number for _, number in _PAIR.findall(row)] if whole else [])
                    lines.append(i)
            return TextTable(name, header, rows, lines, ":")
    return None


def _names(line: str) -> list[str]:
    return [name if parse_column_name(name, 0) else name.split()[-1] for name, _ in _PAIR.findall(line)]
