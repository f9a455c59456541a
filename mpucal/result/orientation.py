"""Names of orientations by the axes printed on a board."""

from __future__ import annotations

import numpy as np

from ..data import Vector

AXES = "XYZ"
# the least component of gravity along an axis that is named
LEAST_NAMED = 0.4
_SHAPES = {1: "side", 2: "edge", 3: "corner"}


def side_down(down: tuple[float, float, float] | Vector) -> str:
    """Name the part of the board that points along the unit vector `down` (3,), such as "side +X" or "edge +X −Y"."""
    d = np.asarray(down, float)
    named = [i for i in range(3) if abs(d[i]) >= LEAST_NAMED] or [int(np.argmax(np.abs(d)))]
    return f"{_SHAPES[len(named)]} {' '.join(('+' if d[i] > 0 else '−') + AXES[i] for i in named)}"


def tilt_down(down: tuple[float, float, float] | Vector) -> str:
    """Name a small tilt from level by the unit vector `down` (3,), such as "lower on the side of +X −Y"."""
    d = np.asarray(down, float)
    level = int(np.argmax(np.abs(d)))
    across = [i for i in range(3) if i != level and abs(d[i]) > 0.15]
    if not across:
        return "level"
    return f"lower on the side of {' '.join(('+' if d[i] > 0 else '−') + AXES[i] for i in across)}"
