"""Map of the directions that have pointed down, in equal-area projection."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

from ..session.events import Direction
from .canvas import Canvas, Point

_CIRCLE = [(math.cos(math.pi * k / 20), math.sin(math.pi * k / 20)) for k in range(41)]
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
    rim = [_at(canvas, radius, x, y) for x, y in _CIRCLE]
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
