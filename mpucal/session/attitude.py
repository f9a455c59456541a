"""The board's attitude, carried from the flat rest by the gyroscope and corrected by gravity.

The room's axes are x to the right of whoever holds the board, y away from them and z up. An attitude is the matrix
(3, 3) that takes the board's axes to the room's.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator

import numpy as np

from ..data import Samples, Vector
from .events import Direction, Quaternion

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
_LAID, _TURNED_OVER = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)

Matrix = tuple[Direction, Direction, Direction]


class Attitude:
    """Follows one board, a step at a time; in plain numbers, which for one step are faster than arrays."""

    def __init__(self) -> None:
        self._q: Quaternion = _LAID
        self._begun = self._levelled = False
        self._rest = Samples.empty()
        self._bias_rad_s: Vector = np.zeros(3)

    def flat(self, rest_rad_s: Vector) -> None:
        """The flat rest is over, where the gyroscope read `rest_rad_s` (3,): from now on it carries the heading."""
        self._levelled, self._bias_rad_s = True, rest_rad_s

    def add(self, samples: Samples, still: bool, rest_rad_s: Vector) -> None:
        """Turn on by `samples`; `rest_rad_s` (3,) is what the gyroscope read at the last rest, until it was flat."""
        if not self._levelled:
            self._bias_rad_s = rest_rad_s
        for seconds, force, rate in self._steps(samples):
            self._step(seconds, force, rate, still)

    @property
    def matrix(self) -> Vector:
        """(3, 3), the attitude at the last sample."""
        return np.array(matrix(self._q))

    def quaternion(self) -> Quaternion:
        """The attitude as a unit quaternion (w, x, y, z) with w >= 0."""
        w, x, y, z = self._q
        return (-w, -x, -y, -z) if w < 0.0 else self._q

    def _steps(self, samples: Samples) -> Iterator[tuple[float, Direction, Direction]]:
        """Of each step that `samples` complete: how long it is, and its mean force and rate."""
        pending = Samples.joined([self._rest, samples])
        t, cuts = pending.t.tolist(), [0]
        while cuts[-1] < len(t) and (cut := bisect_left(t, t[cuts[-1]] + STEP_S - 1e-9)) < len(t):
            cuts.append(cut)
        first = cuts[-1]
        self._rest = Samples(*(array[first:] for array in vars(pending).values()))
        if not first:
            return
        counts = np.diff(cuts)[:, None]
        force = np.add.reduceat(pending.acc[:first], cuts[:-1]) / counts
        rate = np.add.reduceat(pending.gyr[:first], cuts[:-1]) / counts - self._bias_rad_s
        gaps = pending.gap[cuts].tolist()
        for i, (acc, gyr) in enumerate(zip(force.tolist(), rate.tolist(), strict=True)):
            # nobody knows how long the last step before a gap was
            yield STEP_S if gaps[i + 1] else t[cuts[i + 1]] - t[cuts[i]], acc, gyr

    def _step(self, seconds: float, acc: Direction, rate: Direction, still: bool) -> None:
        force = math.hypot(*acc)
        if not self._begun:
            self._begun = True
            x, y, z = acc
            self._q = straight((x / force, y / force, z / force) if force >= FALLING_MPS2 else (0.0, 0.0, 1.0))
            return
        q = _product(self._q, _turn(rate[0] * seconds, rate[1] * seconds, rate[2] * seconds))
        # where no direction is up, the gyroscope alone carries
        if force >= FALLING_MPS2:
            x, y, z = _turned(q, acc)
            aside = math.hypot(x, y)
            missing = math.atan2(aside, z)
            share = 1.0 - math.exp(-seconds / (STILL_S if still else MOVING_S))
            turn = min(share * missing, CORRECT_RAD_S * seconds) / aside if aside else 0.0
            q = _product(_turn(y * turn, -x * turn, 0.0), q)
        if still and not self._levelled:
            most, askew = STRAIGHTEN_RAD_S * seconds, _heading(_product(straight(matrix(q)[2]), _inverse(q)))
            q = _product(_turn(0.0, 0.0, min(max(askew, -most), most)), q)
        size = math.hypot(*q)
        w, x, y, z = q
        self._q = (w / size, x / size, y / size, z / size)


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


def _turned(attitude: Quaternion, v: Direction) -> Direction:
    """The vector `v` of the board's axes in the room's."""
    w, x, y, z = attitude
    a, b, c = v
    # v + 2 w (q x v) + 2 q x (q x v)
    d, e, f = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * d + y * f - z * e),
        b + 2.0 * (w * e + z * d - x * f),
        c + 2.0 * (w * f + x * e - y * d),
    )


def _inverse(attitude: Quaternion) -> Quaternion:
    w, x, y, z = attitude
    return (w, -x, -y, -z)


def _heading(turn: Quaternion) -> float:
    """By how much it turns about the vertical [rad]."""
    w, _, _, z = turn
    return math.atan2(2.0 * w * z, w * w - z * z)


def straight(up: Direction) -> Quaternion:
    """The attitude with the unit vector `up` of the board's axes up nearest to one laid straight."""
    x, y, z = up
    laid = _LAID if z >= 0.0 else _TURNED_OVER
    # the shortest turn to (0, 0, 1) of what points up once it is laid
    x, y, z = _turned(laid, up)
    size = math.hypot(1.0 + z, y, x)
    return _product(((1.0 + z) / size, y / size, -x / size, 0.0), laid)


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
