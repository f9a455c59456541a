"""Orientations in words, by the axes printed on a board."""

from __future__ import annotations

import numpy as np

from ..data import Vector

AXES = "XYZ"
# An axis is worth naming where this much of gravity is to lie along it.
WORTH_NAMING = 0.4
_SHAPES = {1: "side", 2: "edge", 3: "corner"}


def side_down(down: tuple[float, float, float] | Vector) -> str:
    """What points down where the unit vector `down` (3,) does: "side +X", "edge +X −Y", "corner +X −Y +Z"."""
    d = np.asarray(down, float)
    named = [i for i in range(3) if abs(d[i]) >= WORTH_NAMING] or [int(np.argmax(np.abs(d)))]
    return f"{_SHAPES[len(named)]} {' '.join(('+' if d[i] > 0 else '−') + AXES[i] for i in named)}"


def tilt_down(down: tuple[float, float, float] | Vector) -> str:
    """The same for a small tilt from level: "lower on the side of +X −Y"."""
    d = np.asarray(down, float)
    level = int(np.argmax(np.abs(d)))
    across = [i for i in range(3) if i != level and abs(d[i]) > 0.15]
    if not across:
        return "level"
    return f"lower on the side of {' '.join(('+' if d[i] > 0 else '−') + AXES[i] for i in across)}"
