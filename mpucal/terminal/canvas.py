"""Lines and letters on a grid of characters: braille dots, or ASCII strokes."""

from __future__ import annotations

from functools import cache

from rich.text import Text

Point = tuple[float, float]

# Bits of the dots of one character cell in Unicode's braille: _DOTS[row][column].
COLUMNS, ROWS = 2, 4
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_BRAILLE = 0x2800
_ROW_MASKS = tuple(left | right for left, right in _DOTS)
_LEFT, _RIGHT = (sum(row[k] for row in _DOTS) for k in range(COLUMNS))


class Canvas:
    """Dots and letters on `columns` x `rows` characters; a point is (x, y) in dots, y downwards.

    Dots are about square, because a character is twice as high as wide.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._cells = [[0] * columns for _ in range(rows)]
        self._letters: dict[tuple[int, int], tuple[str, str]] = {}

    @property
    def centre(self) -> Point:
        """Middle of the canvas."""
        return (0.5 * (self.columns * COLUMNS - 1), 0.5 * (self.rows * ROWS - 1))

    def dot(self, point: Point) -> None:
        """Draw a dot, unless it is outside."""
        x, y = round(point[0]), round(point[1])
        if 0 <= x < self.columns * COLUMNS and 0 <= y < self.rows * ROWS:
            self._cells[y // ROWS][x // COLUMNS] |= _DOTS[y % ROWS][x % COLUMNS]

    def line(self, start: Point, end: Point) -> None:
        """Draw a straight line."""
        steps = max(round(max(abs(end[0] - start[0]), abs(end[1] - start[1]))), 1)
        for k in range(steps + 1):
            share = k / steps
            self.dot((start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])))

    def letter(self, point: Point, letter: str, style: str) -> None:
        """Draw a letter in place of the dots of its cell, unless it is outside."""
        column, row = round(point[0]) // COLUMNS, round(point[1]) // ROWS
        if 0 <= column < self.columns and 0 <= row < self.rows:
            self._letters[row, column] = (letter, style)

    def lines(self, style: str, unicode: bool) -> list[Text]:
        """Return the rows, with the dots in `style`."""
        glyph = _braille if unicode else _ascii
        drawn = [[glyph(cell) for cell in cells] for cells in self._cells]
        for (row, column), (letter, _) in self._letters.items():
            drawn[row][column] = letter
        lines = [Text("".join(row), style=style) for row in drawn]
        for (row, column), (_, own) in self._letters.items():
            lines[row].stylize(own, column, column + 1)
        return lines


@cache
def _braille(dots: int) -> str:
    return chr(_BRAILLE + dots) if dots else " "


@cache
def _ascii(dots: int) -> str:
    """Return the character whose strokes lie where the dots are."""
    if not dots:
        return " "
    high = [k for k, mask in enumerate(_ROW_MASKS) if dots & mask]
    if high[-1] - high[0] <= 1:
        return "'" if high[-1] <= 1 and not (dots & _LEFT and dots & _RIGHT) else "_" if high[0] >= 2 else "-"
    if not (dots & _LEFT and dots & _RIGHT):
        return "|"
    top_left = bool(dots & _DOTS[high[0]][0])
    bottom_left = bool(dots & _DOTS[high[-1]][0])
    return "|" if top_left == bottom_left else "\\" if top_left else "/"
