"""The board's attitude, carried from the flat rest by the gyroscope and corrected by gravity; the turn that is missing.

The room's axes are x to the right of whoever holds the board, y away from them and z up. An attitude is the matrix
(3, 3) that takes the board's axes to the room's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..calibration.rotation import rotation, shortest_turn
from ..data import Samples, Vector
from .events import Direction, Quaternion
from .windows import Window, Windows

# The rates are taken as constant for so long.
STEP_S = 0.02
# Gravity corrects the tilt with this time constant: at rest, and among the hand's accelerations.
STILL_S, MOVING_S = 0.2, 2.0
# Until the flat rest is over, a board at rest is drawn nearer to straight by at most so much a second.
STRAIGHTEN_RAD_S = math.radians(30.0)
UP = np.array([0.0, 0.0, 1.0])
# A board that lies on its component side was turned over about its x axis.
_TURNED_OVER = np.diag([1.0, -1.0, -1.0])
# The eight ways in which the board's top can be turned, from the right anticlockwise as seen from above.
WAYS = (
    "roll right",
    "tip away and roll right",
    "tip away",
    "tip away and roll left",
    "roll left",
    "tip toward you and roll left",
    "tip toward you",
    "tip toward you and roll right",
)
ROUND_DEG = 5.0


@dataclass(frozen=True)
class Turn:
    """What is missing to a wanted orientation: the angle, the turn in words, and the attitude that it leads to."""

    missing_deg: float
    words: str
    attitude: Quaternion


class Attitude:
    """Follows one board, a sample at a time.

    Attributes
    ----------
    matrix : (3, 3), the attitude at the last sample.
    """

    def __init__(self) -> None:
        self.matrix: Vector = np.eye(3)
        self._begun = self._levelled = False
        self._windows = Windows(STEP_S, spread=False)
        self._bias_rad_s: Vector = np.zeros(3)

    def flat(self, rest_rad_s: Vector) -> None:
        """The flat rest is over, where the gyroscope read `rest_rad_s` (3,): from now on it carries the heading."""
        self._levelled, self._bias_rad_s = True, rest_rad_s

    def add(self, samples: Samples, still: bool, rest_rad_s: Vector) -> None:
        """Turn on by `samples`; `rest_rad_s` (3,) is what the gyroscope read at the last rest, until it was flat."""
        if not self._levelled:
            self._bias_rad_s = rest_rad_s
        for window in self._windows.add(samples):
            self._step(window, still)

    def quaternion(self) -> Quaternion:
        """The attitude as a unit quaternion (w, x, y, z) with w >= 0."""
        return quaternion(self.matrix)

    def turn_to(self, down: Direction) -> Turn:
        """The shortest turn that points the unit vector `down` of the board's axes down."""
        phi = shortest_turn(self.matrix @ np.asarray(down), -UP)
        missing_deg = math.degrees(float(np.linalg.norm(phi)))
        return Turn(missing_deg, turn_in_words(phi), quaternion(rotation(phi) @ self.matrix))

    def _step(self, window: Window, still: bool) -> None:
        up = window.acc / max(float(np.linalg.norm(window.acc)), 1e-9)
        if not self._begun:
            self._begun, self.matrix = True, straight(up)
            return
        seconds = window.end_s - window.start_s
        self.matrix = self.matrix @ rotation((window.gyr - self._bias_rad_s) * seconds)
        share = 1.0 - math.exp(-seconds / (STILL_S if still else MOVING_S))
        self.matrix = rotation(share * shortest_turn(self.matrix @ up, UP)) @ self.matrix
        if still and not self._levelled:
            most = STRAIGHTEN_RAD_S * seconds
            self.matrix = rotation(UP * min(max(self._askew(), -most), most)) @ self.matrix
        u, _, v = np.linalg.svd(self.matrix)
        self.matrix = u @ v

    def _askew(self) -> float:
        """The turn about the vertical to a board that was laid down straight [rad]."""
        turn = straight(self.matrix[2]) @ self.matrix.T
        return math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])


def straight(up: Vector) -> Vector:
    """(3, 3) the attitude with the unit vector `up` (3,) of the board's axes up nearest to one laid straight."""
    laid = np.eye(3) if up[2] >= 0.0 else _TURNED_OVER
    return np.asarray(rotation(shortest_turn(laid @ up, UP)) @ laid)


def turn_in_words(phi: Vector) -> str:
    """The turn by `phi` (3,) [rad] about a horizontal axis of the room: "roll left 60 deg"."""
    angle_deg = math.degrees(float(np.linalg.norm(phi)))
    rounded = ROUND_DEG * round(angle_deg / ROUND_DEG)
    if rounded == 0.0:
        return ""
    # the top goes where the vertical is turned to
    toward = math.atan2(-phi[0], phi[1])
    return f"{WAYS[round(toward / (math.pi / 4.0)) % len(WAYS)]} {rounded:.0f} deg"


def quaternion(matrix: Vector) -> Quaternion:
    """(w, x, y, z) with w >= 0 of a rotation (3, 3); its largest component comes of the diagonal (Shepperd 1978)."""
    m = matrix
    squares = np.array(
        [
            1.0 + m[0, 0] + m[1, 1] + m[2, 2],
            1.0 + m[0, 0] - m[1, 1] - m[2, 2],
            1.0 - m[0, 0] + m[1, 1] - m[2, 2],
            1.0 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    rows = (
        (squares[0], x, y, z),
        (x, squares[1], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]),
        (y, m[0, 1] + m[1, 0], squares[2], m[1, 2] + m[2, 1]),
        (z, m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[3]),
    )
    q = np.array(rows[int(squares.argmax())])
    q /= math.copysign(float(np.linalg.norm(q)), q[0] if q[0] else 1.0)
    a, b, c, d = q.tolist()
    return (a, b, c, d)
