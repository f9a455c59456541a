"""Lines that name each number, as sketches print for Arduino's serial plotter: `AccelX:0.12,AccelY:...,GyroX:...`."""

from __future__ import annotations

import re

from .names import ACC, GYR, column_named, columns_of, three
from .text import PREAMBLE, TextTable

# lines of a log that names all three of a sensor at once
SNIFFED = 20_000
# a name of one or two words, `:` or `=`, and a number; bounded, so that a long line of letters takes no long time
_NAME, _NUMBER = (
    r"(?<!\w)((?:[A-Za-z]{1,20} )?[A-Za-z_]\w{0,40})",
    r"([-+]?(?:\d{1,20}\.?\d{0,20}|\.\d{1,20})(?:[eE][-+]?\d{1,3})?)",
)
_PAIR = re.compile(rf"{_NAME}\s?[:=][ \t]{{0,9}}{_NUMBER}(?![\w:])")
# a line for each sensor, as in Adafruit's examples: `Acceleration X: 0.1, Y: ...` and `Rotation X: 0.2, Y: ...`
_AXES = re.compile(r"^(Acceleration|Rotation) X:([^,\n]{1,30}),[ ]?Y:([^,\n]{1,30}),[ ]?Z:", re.MULTILINE)
_TWO_LINES = re.compile(r"^(AccelerationX:[^\n]{1,90})\n(?=RotationX:)", re.MULTILINE)


# all three of a sensor, as a log has them: `accel=(9252, -5612, -12084)`
_THREE = re.compile(
    r"(?<!\w)([A-Za-z_]\w{0,40})\s?[:=]\s?[(\[]([^,()\[\]\n]{1,30}),([^,()\[\]\n]{1,30}),([^,()\[\]\n]{1,30})[)\]]"
)


def labelled_table(text: str, name: str) -> TextTable | None:
    """The table in such lines; None where no line names all six. What stands between them is left out."""
    text = _TWO_LINES.sub(r"\1, ", _AXES.sub(r"\1X:\2, \1Y:\3, \1Z:", text))
    text, threes = _THREE.subn(r"\1_x=\2, \1_y=\3, \1_z=\4", text)
    # in a log they may come late
    looked_at = SNIFFED if threes > PREAMBLE else PREAMBLE
    for line in text.split("\n", looked_at)[:looked_at]:
        header = _names(line)
        columns = columns_of(header)
        if three(columns, ACC) and three(columns, GYR):
            measured = [header[c.place] for c in columns if c.quantity in (ACC, GYR)]
            part = re.compile(rf"(?<!\w)({'|'.join(map(re.escape, measured))})\s?[:=]")
            found, lost = [], []
            for i, row in enumerate(text.split("\n"), 1):
                if _names(row) == header:
                    found.append((i, _PAIR.findall(row)))
                elif part.search(row):
                    lost.append(i)
            rows, lines = [[n for _, n in row] for _, row in found], [i for i, _ in found]
            return TextTable(name, header, rows, lines, ":", lost)
    return None


def _names(line: str) -> list[str]:
    return [name if column_named(name, 0) else name.split()[-1] for name, _ in _PAIR.findall(line)]
