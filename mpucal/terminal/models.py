"""Models of breakouts and a vehicle, as strokes in their own axes (half a board's length is 1)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

from ..session.boards import BOARDS
from ..session.events import Direction

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
