"""Which way the board is to be turned, in the words of whoever holds it, and the attitude that this leads to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..calibration.rotation import rotation, shortest_turn
from ..data import Vector
from .events import Direction

UP = np.array([0.0, 0.0, 1.0])
# The eight ways in which the board's top can be turned, from the right anticlockwise as seen from above.
WAYS = (
    "roll it to the right",
    "tip it away and right",
    "tip it away from you",
    "tip it away and left",
    "roll it to the left",
    "tip it toward you and left",
    "tip it toward you",
    "tip it toward you and right",
)
ROUND_DEG = 5.0
# A way is kept as long as it leads so near to the wanted orientation ...
KEPT_RAD = math.radians(10.0)
# ... and its words, as long as it is so near to what they say.
SAID_RAD = math.radians(30.0)
# From one call to the next the wanted attitude turns about the vertical by no more.
SLEW_RAD = math.radians(15.0)


@dataclass(frozen=True)
class Turn:
    """What is missing to a wanted orientation: the angle, the turn in words, and the attitude (3, 3) it leads to."""

    missing_deg: float
    words: str
    attitude: Vector


class Way:
    """The way to one orientation after the other.

    The shortest turn is kept to: of a board that is nearly upside down any way is the shortest, and another one after
    each tremor.
    """

    def __init__(self) -> None:
        self._to: Direction | None = None
        self._toward = 0.0
        self._said = 0
        self._wanted: Vector = np.eye(3)

    def turn_to(self, down: Direction, attitude: Vector) -> Turn:
        """The turn of a board with the given attitude (3, 3) that points the unit vector `down` of its axes down."""
        new = down != self._to
        x, y, z = (attitude @ np.asarray(down)).tolist()
        missing = math.atan2(math.hypot(x, y), -z)
        self._keep_to(math.atan2(y, x), missing, new)
        # about this axis the top goes that way
        along_x, along_y = math.cos(self._toward), math.sin(self._toward)
        turn = math.atan2(x * along_x + y * along_y, -z)
        turned = rotation(np.array([-turn * along_y, turn * along_x, 0.0])) @ attitude
        wanted = rotation(shortest_turn(turned @ np.asarray(down), -UP)) @ turned
        if not new:
            most = min(max(heading(wanted, self._wanted), -SLEW_RAD), SLEW_RAD)
            wanted = rotation(UP * most) @ self._wanted
        self._to, self._wanted = down, wanted
        rounded = ROUND_DEG * round(math.degrees(missing) / ROUND_DEG)
        words = f"{rounded:.0f} deg more, {WAYS[self._said]}" if rounded else ""
        return Turn(math.degrees(missing), words, wanted)

    def _keep_to(self, shortest: float, missing: float, new: bool) -> None:
        """Turn the way no more than it needs to lead there."""
        if new:
            # where any way will do, it is a simple one
            simple = missing > math.pi - KEPT_RAD
            self._toward = _angle(2 * round(shortest / (math.pi / 2.0)) if simple else _nearest(shortest))
        aside = _wrapped(self._toward - shortest)
        if abs(aside) > math.pi / 2.0 and missing < math.pi - KEPT_RAD:
            aside = _wrapped(aside + math.pi)
        reach = math.sin(KEPT_RAD) / max(math.sin(missing), 1e-9)
        most = math.asin(reach) if reach < 1.0 else math.pi
        self._toward = shortest + min(max(aside, -most), most)
        if new or abs(_wrapped(self._toward - _angle(self._said))) > SAID_RAD:
            self._said = _nearest(self._toward)


def heading(attitude: Vector, other: Vector) -> float:
    """The turn about the vertical to one attitude (3, 3) from another [rad]."""
    turn = attitude @ other.T
    return math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])


def _nearest(toward: float) -> int:
    return round(toward / (math.pi / 4.0)) % len(WAYS)


def _angle(way: int) -> float:
    return way * math.pi / 4.0


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
