"""The board's attitude, carried from the flat rest by the gyroscope and corrected by gravity.

The room's axes are x to the right of whoever holds the board, y away from them and z up. An attitude is the matrix
(3, 3) that takes the board's axes to the room's.
"""

from __future__ import annotations

import math

import numpy as np

from ..calibration.rotation import rotation, shortest_turn
from ..data import Samples, Vector
from ..rests.windows import Window, Windows
from .events import Direction, Quaternion
from .way import UP, heading

# The rates are taken as constant for so long.
STEP_S = 0.02
# Gravity corrects the tilt with this time constant: at rest, and among the hand's accelerations.
STILL_S, MOVING_S = 0.2, 2.0
# ... by at most so much a second: before there was a rest, a turning board may have been taken for one at rest.
CORRECT_RAD_S = math.radians(60.0)
# Until the flat rest is over, a board at rest is drawn nearer to straight by at most so much a second.
STRAIGHTEN_RAD_S = math.radians(30.0)
# An accelerometer that reads less falls, or is dead.
FALLING_MPS2 = 1e-3
# A board that lies on its component side was turned over about its x axis.
_TURNED_OVER = np.diag([1.0, -1.0, -1.0])

Matrix = tuple[Direction, Direction, Direction]


class Attitude:
    """Follows one board, a sample at a time; in plain numbers, which for one step are faster than arrays."""

    def __init__(self) -> None:
        self._q: Quaternion = (1.0, 0.0, 0.0, 0.0)
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

    @property
    def matrix(self) -> Vector:
        """(3, 3), the attitude at the last sample."""
        return np.array(matrix(self._q))

    def quaternion(self) -> Quaternion:
        """The attitude as a unit quaternion (w, x, y, z) with w >= 0."""
        w, x, y, z = self._q
        return (-w, -x, -y, -z) if w < 0.0 else self._q

    def _step(self, window: Window, still: bool) -> None:
        force = math.hypot(*window.acc.tolist())
        if not self._begun:
            self._begun = True
            self._q = quaternion(straight(window.acc / force if force >= FALLING_MPS2 else UP))
            return
        seconds = window.end_s - window.start_s
        q = _product(self._q, _turn(*((window.gyr - self._bias_rad_s) * seconds).tolist()))
        # where no direction is up, the gyroscope alone carries
        if force >= FALLING_MPS2:
            x, y, z = (sum(m * a for m, a in zip(row, window.acc.tolist(), strict=True)) for row in matrix(q))
            aside = math.hypot(x, y)
            missing = math.atan2(aside, z)
            share = 1.0 - math.exp(-seconds / (STILL_S if still else MOVING_S))
            turn = min(share * missing, CORRECT_RAD_S * seconds) / aside if aside else 0.0
            q = _product(_turn(y * turn, -x * turn, 0.0), q)
        if still and not self._levelled:
            now = np.array(matrix(q))
            most, askew = STRAIGHTEN_RAD_S * seconds, heading(straight(now[2]), now)
            q = _product(_turn(0.0, 0.0, min(max(askew, -most), most)), q)
        w, x, y, z = (part / math.hypot(*q) for part in q)
        self._q = (w, x, y, z)


def _turn(x: float, y: float, z: float) -> Quaternion:
    """By the rotation vector (x, y, z) [rad]."""
    half = 0.5 * math.hypot(x, y, z)
    scale = 0.5 * (math.sin(half) / half if half else 1.0)
    return (math.cos(half), scale * x, scale * y, scale * z)


def _product(p: Quaternion, q: Quaternion) -> Quaternion:
    """First the turn q, then p."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def matrix(attitude: Quaternion) -> Matrix:
    """The rotation (3, 3) of a unit quaternion (w, x, y, z)."""
    w, x, y, z = attitude
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def straight(up: Vector) -> Vector:
    """(3, 3) the attitude with the unit vector `up` (3,) of the board's axes up nearest to one laid straight."""
    laid = np.eye(3) if up[2] >= 0.0 else _TURNED_OVER
    return np.asarray(rotation(shortest_turn(laid @ up, UP)) @ laid)


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
