"""Names of orientations by the axes printed on a board."""

from __future__ import annotations

from ..data import Vector

AXES = "XYZ"
# the least component of gravity along an axis that is named
LEAST_NAMED = 0.4
_SHAPES = {1: "side", 2: "edge", 3: "corner"}


def named_axes(down: tuple[float, float, float] | Vector, least: float = LEAST_NAMED) -> list[str]:
    """Name the axes along which a direction `down` (3,) has at least this component: ["+X", "−Y"]."""
    return [f"{'+' if down[i] > 0 else '−'}{AXES[i]}" for i in range(3) if abs(down[i]) >= least]


def side_down(down: tuple[float, float, float] | Vector) -> str:
    """Name the part of the board that points along the unit vector `down` (3,), such as "side +X" or "edge +X −Y"."""
    axes = named_axes(down)
    return f"{_SHAPES[len(axes)]} {' '.join(axes)}"
