"""Picture of the board or the vehicle with its axes, in the attitude of a Meter."""

from __future__ import annotations

import math
from itertools import pairwise

from ..session.attitude import rotate
from ..session.events import Direction, Quaternion
from .canvas import Canvas, Point
from .models import MODELS

View = tuple[Direction, Direction, Direction]

_AXES: tuple[tuple[str, Direction, str], ...] = (
    ("X", (1.0, 0.0, 0.0), "bold red"),
    ("Y", (0.0, 1.0, 0.0), "bold green"),
    ("Z", (0.0, 0.0, 1.0), "bold blue"),
)
# Distances from the middle to the ends of the axes, and to their letters.
_TIPS, _LETTERS = (1.35, 1.1, 0.75), (1.62, 1.38, 1.05)
# Turns and tilts of the view: first from the front, above and a little from the right, then others.
_VIEWS_DEG = (-28.0, 28.0), (30.0, 52.0, 12.0, 70.0)
# Least visible share of the plate's face; a view that shows less is too near to its edge.
_LEAST_FACE = 0.35
_REACH = 1.75
# On fewer rows the lines of a plate's edge would merge.
_LARGE = 14


def picture(kind: str, attitude: Quaternion, columns: int, rows: int) -> Canvas:
    """Return the picture of a kind of board (`models.py`) in an attitude."""
    canvas, model = Canvas(columns, rows), MODELS[kind]
    face = rotate(attitude, (0.0, 0.0, model.up))
    across, up, eye = view_of(face)
    scale = min(canvas.centre[0], canvas.centre[1] * 1.15) / _REACH

    def seen(point: Direction) -> Point:
        room = rotate(attitude, point)
        return (canvas.centre[0] + scale * _dot(across, room), canvas.centre[1] - scale * _dot(up, room))

    for stroke in model.strokes(_dot(eye, face) > 0.0, rows >= _LARGE):
        for a, b in pairwise(stroke):
            canvas.line(seen(a), seen(b))
    for (letter, axis, style), tip, end in zip(_AXES, _TIPS, _LETTERS, strict=True):
        canvas.line(seen((0.0, 0.0, 0.0)), seen(_scaled(axis, tip)))
        canvas.letter(seen(_scaled(axis, end)), letter, style)
    return canvas


def view_of(face: Direction) -> View:
    """Return unit vectors of the room across, up and toward the eye, from which a board is not seen edge-on.

    face : unit vector at right angles to the board, in the room's axes.
    """
    views = [_view(turn, tilt) for tilt in _VIEWS_DEG[1] for turn in _VIEWS_DEG[0]]
    for view in views:
        if abs(_dot(view[2], face)) >= _LEAST_FACE:
            return view
    return max(views, key=lambda view: abs(_dot(view[2], face)))


def _view(turn_deg: float, tilt_deg: float) -> View:
    turn, tilt = math.radians(turn_deg), math.radians(tilt_deg)
    across = (math.cos(turn), -math.sin(turn), 0.0)
    away = (math.sin(turn), math.cos(turn), 0.0)
    up = (away[0] * math.sin(tilt), away[1] * math.sin(tilt), math.cos(tilt))
    eye = (-away[0] * math.cos(tilt), -away[1] * math.cos(tilt), math.sin(tilt))
    return across, up, eye


def _dot(a: Direction, b: Direction) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _scaled(v: Direction, factor: float) -> Direction:
    return (factor * v[0], factor * v[1], factor * v[2])
