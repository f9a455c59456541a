"""Kinds of boards, and the description of each as it lies flat, which the operator confirms by leaving it there."""

from __future__ import annotations

import math

from ..session.events import Direction

# A board lies flat if at least this share of gravity is along its z axis.
LIES = math.cos(math.radians(20.0))
# Descriptions by kind of board, with -z down and with +z down. The z axis of a vehicle points down.
_SIDES = {
    "gy-521": ("Chip up, pins toward you", "Chip down, pins away from you"),
    "plain": ("Chip up, +Y away from you", "Chip down, +Y toward you"),
    "vehicle": ("Upside down, nose to the right", "On its feet, nose to the right"),
}
BOARD, VEHICLE = "gy-521", "vehicle"
BOARDS = tuple(_SIDES)


def flat_description(down: Direction, board: str) -> str:
    """Return the question to confirm for a `board` whose unit vector `down` points down."""
    if abs(down[2]) < LIES:
        return "The board is tilted now."
    return f"{_SIDES[board][down[2] > 0.0]}? Then leave it. If not, turn it."
