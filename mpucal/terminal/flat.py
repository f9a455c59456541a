"""What the board looks like as it lies flat, in words: for whoever sees it to confirm by leaving it there."""

from __future__ import annotations

import math

from ..session.events import Direction

# the part of gravity along z, at least, of a board that lies
LIES = math.cos(math.radians(20.0))
# by the picture that is drawn: what it is with its component side up and down, and where its front is then
_SIDES = {
    "gy-521": ("the chip faces up, the pins are toward you", "the chip faces down, the pins are away from you"),
    "plain": ("the chip faces up, +Y points away from you", "the chip faces down, +Y points toward you"),
    # its z points down
    "vehicle": ("it is upside down, its nose to the right", "it stands on its feet, its nose to the right"),
}
BOARD, VEHICLE = "gy-521", "vehicle"
BOARDS = tuple(_SIDES)


def as_seen(down: Direction, board: str) -> str:
    """What is to be confirmed where the unit vector `down` of the axes of a `board` points down."""
    if abs(down[2]) < LIES:
        return "Now it is tilted."
    return f"Is it so: {_SIDES[board][down[2] > 0.0]}? Leave it, and that says yes; if not, turn it."
