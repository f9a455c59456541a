"""Pictures of braille dots or ASCII strokes: the board or vehicle in its attitude, and the map of its orientations."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise, product

from rich.text import Text

from ..session.attitude import rotate
from ..session.boards import BOARDS
from ..session.events import Direction, Quaternion
from .view import Eye, dot

Point = tuple[float, float]

# Bits of the dots of one character cell in Unicode's braille: _DOTS[row][column].
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_ROW_MASKS, _COLUMN_MASKS = tuple(map(sum, _DOTS)), tuple(map(sum, zip(*_DOTS, strict=True)))
ROWS, COLUMNS = len(_ROW_MASKS), len(_COLUMN_MASKS)
_LEFT, _RIGHT = _COLUMN_MASKS


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
    # Unicode's braille begins at U+2800.
    return chr(0x2800 + dots) if dots else " "


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


# Letter, style and direction of each axis, and the distances from the middle to its end and to the letter.
_AXES: tuple[tuple[str, str, Direction, float, float], ...] = (
    ("X", "bold red", (1.0, 0.0, 0.0), 1.35, 1.62),
    ("Y", "bold green", (0.0, 1.0, 0.0), 1.1, 1.38),
    ("Z", "bold blue", (0.0, 0.0, 1.0), 0.75, 1.05),
)


def draw_board(kind: str, attitude: Quaternion, eye: Eye, columns: int, rows: int) -> Canvas:
    """Return the picture of a kind of board in an attitude."""
    canvas, model = Canvas(columns, rows), MODELS[kind]
    face = rotate(attitude, (0.0, 0.0, model.up))
    across, up, toward = eye.axes
    # The farthest letter is at 1.62.
    scale = min(canvas.centre[0], canvas.centre[1] * 1.15) / 1.75

    def seen(point: Direction) -> Point:
        room = rotate(attitude, point)
        return (canvas.centre[0] + scale * dot(across, room), canvas.centre[1] - scale * dot(up, room))

    # On fewer than 14 rows the lines of a plate's edge would merge.
    for stroke in model.strokes(dot(toward, face) > 0.0, rows >= 14):
        for a, b in pairwise(stroke):
            canvas.line(seen(a), seen(b))
    for letter, style, axis, tip, end in _AXES:
        canvas.line(seen((0.0, 0.0, 0.0)), seen(_scaled(axis, tip)))
        canvas.letter(seen(_scaled(axis, end)), letter, style)
    return canvas


def _scaled(v: Direction, factor: float) -> Direction:
    return (factor * v[0], factor * v[1], factor * v[2])


Stroke = tuple[Direction, ...]


@dataclass(frozen=True)
class Model:
    """Model of a board, as strokes from point to point.

    Attributes
    ----------
    up : sign of z on the upper side. always, above, below : strokes that are visible from everywhere, from above, and
        from below. fine : strokes for large pictures.
    """

    up: float
    always: tuple[Stroke, ...]
    above: tuple[Stroke, ...]
    below: tuple[Stroke, ...]
    fine: tuple[Stroke, ...]

    def strokes(self, front: bool, large: bool) -> Iterable[Stroke]:
        """Yield the visible strokes; front : the upper side faces the eye."""
        yield from self.always
        yield from self.above if front else self.below
        if large:
            yield from self.fine


def _around(corners: Iterable[tuple[float, float]], z: float) -> Stroke:
    points = tuple((x, y, z) for x, y in corners)
    return (*points, points[0])


def _rectangle(x: float, y: float, z: float) -> Stroke:
    return _around(((-x, -y), (x, -y), (x, y), (-x, y)), z)


def _breakout(*fine: Stroke) -> Model:
    """Return a plate with its chip on the component side."""
    x, y, z = 1.0, 0.7, 0.09
    faces = _rectangle(x, y, z), _rectangle(x, y, -z)
    return Model(1.0, (), (faces[0], _rectangle(0.28, 0.28, z)), faces[1:], (*faces, *fine))


def _pins() -> Iterable[Stroke]:
    """Yield a row of eight pins along the edge at -y, which is nearest to the operator of a board laid flat."""
    for k in range(8):
        x = 0.8 * (2 * k / 7 - 1.0)
        yield (x, -0.6, -0.09), (x, -0.6, -0.3)


def _vehicle() -> Model:
    """Return a multicopter: body with its nose toward +x, four rotors above, and two skids below (z points down)."""
    body = _around(((1.0, 0.0), (0.5, 0.25), (-0.6, 0.25), (-0.6, -0.25), (0.5, -0.25)), 0.0)
    nose = (0.5, 0.25, 0.0), (0.5, -0.25, 0.0)
    octagon = [math.radians(45.0 * k) for k in range(8)]
    rotors, arms, skids = [], [], []
    for i, j in product((1, -1), (1, -1)):
        rotors.append(_around([(0.7 * i + 0.3 * math.cos(a), 0.8 * j + 0.3 * math.sin(a)) for a in octagon], -0.1))
        arms.append(((0.3 * i, 0.25 * j, 0.0), (0.52 * i, 0.56 * j, -0.1)))
        skids.append(((0.3 * i, 0.25 * j, 0.0), (0.3 * i, 0.3 * j, 0.4)))
    skids += [((-0.5, 0.3 * j, 0.4), (0.5, 0.3 * j, 0.4)) for j in (1, -1)]
    return Model(-1.0, (body, *arms, *rotors), (), tuple(skids), (nose, *skids))


MODELS = dict(zip(BOARDS, (_breakout(*_pins()), _breakout(), _vehicle()), strict=True))


MARKS_UNICODE = {"held": "●", "passed": "∙", "wanted": "◎", "now": "+"}
MARKS_ASCII = {"held": "o", "passed": ".", "wanted": "X", "now": "+"}
_STYLES = {"held": "bold green", "passed": "green", "wanted": "bold yellow reverse", "now": "bold"}


def draw_half(upper: bool, marks: Iterable[tuple[str, Direction]], columns: int, rows: int, unicode: bool) -> Canvas:
    """Return a map of one half of the sphere, with the board's x to the right and y upwards.

    Parameters
    ----------
    upper : the half with z > 0 (the component side down). marks : kind ("held", "passed", "wanted", "now") and
        direction of each mark; later ones cover earlier ones.
    """
    canvas = Canvas(columns, rows)
    radius = min(canvas.centre) - 0.5
    rim = [_at(canvas, radius, math.cos(math.pi * k / 20), math.sin(math.pi * k / 20)) for k in range(41)]
    for before, after in pairwise(rim):
        canvas.line(before, after)
    glyphs = MARKS_UNICODE if unicode else MARKS_ASCII
    for name, (x, y, z) in marks:
        if (z > 0.0) == upper:
            # Lambert's azimuthal equal-area projection, scaled so that the rim of the half is at 1.
            shrink = 1.0 / math.sqrt(1.0 + abs(z))
            canvas.letter(_at(canvas, 0.92 * radius, x * shrink, y * shrink), glyphs[name], _STYLES[name])
    return canvas


def _at(canvas: Canvas, radius: float, x: float, y: float) -> Point:
    return (canvas.centre[0] + radius * x, canvas.centre[1] - radius * y)
