"""The picture of the board: a plate with its chip and its axes, turned as a down direction says."""

from __future__ import annotations

import math

from ..session.events import Direction
from .canvas import Canvas, Point

# half a plate: length along x, width along y, thickness along z
HALF = (1.0, 0.7, 0.09)
_CHIP = 0.28
_AXES: tuple[tuple[str, Direction, str], ...] = (
    ("X", (1.0, 0.0, 0.0), "bold red"),
    ("Y", (0.0, 1.0, 0.0), "bold green"),
    ("Z", (0.0, 0.0, 1.0), "bold blue"),
)
# where axes end and where their letters stand, seen from the middle
_TIPS, _LETTERS = (1.35, 1.1, 0.75), (1.62, 1.38, 1.05)
# the eye looks at the plate from the front, a little from the right and from above
_TURN, _TILT = math.radians(-28.0), math.radians(24.0)
_REACH = 1.75
_LARGE = 14

Matrix = tuple[Direction, Direction, Direction]


def picture(down: Direction, columns: int, rows: int) -> Canvas:
    """The board with the unit vector `down` of its own axes pointing down."""
    canvas = Canvas(columns, rows)
    attitude = held(down)
    scale = min(canvas.centre[0], canvas.centre[1] * 1.15) / _REACH

    def seen(point: Direction) -> Point:
        across, up = _projected(_times(attitude, point))
        return (canvas.centre[0] + scale * across, canvas.centre[1] - scale * up)

    def rectangle(x: float, y: float, z: float) -> None:
        corners = [seen((i * x, j * y, z)) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for k in range(4):
            canvas.line(corners[k - 1], corners[k])

    x, y, z = HALF
    front = _towards_the_eye(_times(attitude, (0.0, 0.0, 1.0))) > 0.0
    rectangle(x, y, z if front else -z)
    if rows >= _LARGE:  # where both edges of the plate do not run into each other
        rectangle(x, y, -z if front else z)
    if front:
        rectangle(_CHIP, _CHIP, z)
    for (letter, axis, style), tip, end in zip(_AXES, _TIPS, _LETTERS, strict=True):
        canvas.line(seen((0.0, 0.0, 0.0)), seen(_scaled(axis, tip)))
        canvas.letter(seen(_scaled(axis, end)), letter, style)
    return canvas


def held(down: Direction) -> Matrix:
    """The rotation from the board's axes to the room's (x right, y away, z up) that takes `down` downwards.

    Of all of them the one nearest to the board lying flat; upside down, it was turned over about its x axis.
    """
    size = math.sqrt(sum(value * value for value in down)) or 1.0
    a, b, c = (value / size for value in down)
    if c > 1.0 - 1e-6:
        return ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    # Rodrigues' formula for the turn from (a, b, c) to (0, 0, -1)
    k = 1.0 / (1.0 - c)
    return ((1.0 - a * a * k, -a * b * k, a), (-a * b * k, 1.0 - b * b * k, b), (-a, -b, -c))


def _projected(point: Direction) -> Point:
    """Across and up, as the eye sees a point of the room."""
    x, y, z = point
    x, y = x * math.cos(_TURN) - y * math.sin(_TURN), x * math.sin(_TURN) + y * math.cos(_TURN)
    return x, y * math.sin(_TILT) + z * math.cos(_TILT)


def _towards_the_eye(point: Direction) -> float:
    x, y, z = point
    return -(x * math.sin(_TURN) + y * math.cos(_TURN)) * math.cos(_TILT) + z * math.sin(_TILT)


def _times(matrix: Matrix, v: Direction) -> Direction:
    x, y, z = (row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in matrix)
    return (x, y, z)


def _scaled(v: Direction, factor: float) -> Direction:
    return (factor * v[0], factor * v[1], factor * v[2])
