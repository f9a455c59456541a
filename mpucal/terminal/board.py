"""The picture of the board: a plate with its chip, its pins and its axes, in the attitude that a Meter carries."""

from __future__ import annotations

import math

from ..session.events import Direction, Quaternion
from .canvas import Canvas, Point

# half a breakout: length along x, width along y, thickness along z
HALF = (1.0, 0.7, 0.09)
_CHIP = 0.28
# a row of pins along the edge at -y, which is nearest to whoever laid it flat
_PINS, _PIN_AT, _PIN_DOWN = 8, -0.6, -0.3
_AXES: tuple[tuple[str, Direction, str], ...] = (
    ("X", (1.0, 0.0, 0.0), "bold red"),
    ("Y", (0.0, 1.0, 0.0), "bold green"),
    ("Z", (0.0, 0.0, 1.0), "bold blue"),
)
# where axes end and where their letters stand, seen from the middle
_TIPS, _LETTERS = (1.35, 1.1, 0.75), (1.62, 1.38, 1.05)
# the eye looks from the front, from above and a little from the right
_TURN_DEG, _TILT_DEG = -28.0, 30.0
# ... or from where the plate is no thinner than this, as a share of its area
_LEAST_FACE = 0.35
_VIEWS_DEG = (_TURN_DEG, 28.0), (_TILT_DEG, 52.0, 12.0, 70.0)
_REACH = 1.75
_LARGE = 14

Matrix = tuple[Direction, Direction, Direction]


def picture(attitude: Quaternion, columns: int, rows: int) -> Canvas:
    """The board with the given attitude."""
    canvas = Canvas(columns, rows)
    board = matrix(attitude)
    across, up, eye = view_of(board)
    scale = min(canvas.centre[0], canvas.centre[1] * 1.15) / _REACH

    def seen(point: Direction) -> Point:
        room = _times(board, point)
        return (canvas.centre[0] + scale * _dot(across, room), canvas.centre[1] - scale * _dot(up, room))

    def rectangle(x: float, y: float, z: float) -> None:
        corners = [seen((i * x, j * y, z)) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for k in range(4):
            canvas.line(corners[k - 1], corners[k])

    x, y, z = HALF
    front = _dot(eye, _times(board, (0.0, 0.0, 1.0))) > 0.0
    rectangle(x, y, z if front else -z)
    if rows >= _LARGE:  # where both edges of the plate do not run into each other
        rectangle(x, y, -z if front else z)
        for k in range(_PINS):
            pin = 0.8 * x * (2 * k / (_PINS - 1) - 1.0)
            canvas.line(seen((pin, _PIN_AT, z if front else -z)), seen((pin, _PIN_AT, _PIN_DOWN)))
    if front:
        rectangle(_CHIP, _CHIP, z)
    for (letter, axis, style), tip, end in zip(_AXES, _TIPS, _LETTERS, strict=True):
        canvas.line(seen((0.0, 0.0, 0.0)), seen(_scaled(axis, tip)))
        canvas.letter(seen(_scaled(axis, end)), letter, style)
    return canvas


def matrix(attitude: Quaternion) -> Matrix:
    """The rotation (3, 3) of a unit quaternion (w, x, y, z)."""
    w, x, y, z = attitude
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def view_of(board: Matrix) -> Matrix:
    """Unit vectors of the room that are seen across, up and toward the eye: the usual view, unless it shows an edge."""
    face = (board[0][2], board[1][2], board[2][2])
    views = [_view(turn, tilt) for tilt in _VIEWS_DEG[1] for turn in _VIEWS_DEG[0]]
    for view in views:
        if abs(_dot(view[2], face)) >= _LEAST_FACE:
            return view
    return max(views, key=lambda view: abs(_dot(view[2], face)))


def _view(turn_deg: float, tilt_deg: float) -> Matrix:
    turn, tilt = math.radians(turn_deg), math.radians(tilt_deg)
    across = (math.cos(turn), -math.sin(turn), 0.0)
    away = (math.sin(turn), math.cos(turn), 0.0)
    up = (away[0] * math.sin(tilt), away[1] * math.sin(tilt), math.cos(tilt))
    eye = (-away[0] * math.cos(tilt), -away[1] * math.cos(tilt), math.sin(tilt))
    return across, up, eye


def _times(matrix: Matrix, v: Direction) -> Direction:
    x, y, z = (_dot(row, v) for row in matrix)
    return (x, y, z)


def _dot(a: Direction, b: Direction) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _scaled(v: Direction, factor: float) -> Direction:
    return (factor * v[0], factor * v[1], factor * v[2])
