"""The board's attitude, carried from the flat rest by the gyroscope and corrected by gravity.

The room's axes are x to the operator's right, y away from the operator and z up. An attitude is the unit quaternion
(w, x, y, z) that takes the board's axes to the room's.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator

import numpy as np

from ..data import Samples, Vector
from .events import LAID, Direction, Quaternion

# Length of an integration step, in which the rates count as constant.
STEP_S = 0.04
# Time constants with which gravity corrects the tilt: at rest, and among the hand's accelerations.
STILL_S, MOVING_S = 0.2, 2.0
# Limit of that correction: before the first rest, a turning board may have been taken for one at rest.
CORRECT_RAD_S = math.radians(60.0)
# Until the flat rest ends, the attitude of a board at rest turns about the vertical to straight, at most at this rate.
STRAIGHTEN_RAD_S = math.radians(30.0)


class Attitude:
    """Attitude filter of one board. It computes with plain floats, which are faster than arrays for single steps."""

    def __init__(self) -> None:
        self._q: Quaternion = LAID
        self._begun = self._levelled = False
        self._rest = Samples.empty()
        self._bias_rad_s: Vector = np.zeros(3)

    def flat(self, rest_rad_s: Vector) -> None:
        """End the flat rest, with the gyroscope's mean rates (3,) there: from now on it carries the heading."""
        self._levelled, self._bias_rad_s = True, rest_rad_s

    def add(self, samples: Samples, still: bool, rest_rad_s: Vector) -> None:
        """Integrate `samples`; `rest_rad_s` (3,), the rates at the last rest, count until the flat rest has ended."""
        if not self._levelled:
            self._bias_rad_s = rest_rad_s
        for seconds, force, rate in self._steps(samples):
            self._step(seconds, force, rate, still)

    @property
    def now(self) -> Quaternion:
        """Attitude at the last sample."""
        return self._q

    def _steps(self, samples: Samples) -> Iterator[tuple[float, Direction, Direction]]:
        """Yield the length [s], mean acceleration and mean rate of each step that `samples` complete."""
        pending = Samples.joined([self._rest, samples])
        t, cuts = pending.t.tolist(), [0]
        while cuts[-1] < len(t) and (cut := bisect_left(t, t[cuts[-1]] + STEP_S - 1e-9)) < len(t):
            cuts.append(cut)
        first = cuts[-1]
        self._rest = pending.at(slice(first, None))
        if not first:
            return
        counts = np.diff(cuts)[:, None]
        force = np.add.reduceat(pending.acc[:first], cuts[:-1]) / counts
        rate = np.add.reduceat(pending.gyr[:first], cuts[:-1]) / counts - self._bias_rad_s
        gaps = pending.gap[cuts].tolist()
        for i, (acc, gyr) in enumerate(zip(force.tolist(), rate.tolist(), strict=True)):
            # The length of the last step before a gap is unknown.
            yield STEP_S if gaps[i + 1] else t[cuts[i + 1]] - t[cuts[i]], acc, gyr

    def _step(self, seconds: float, acc: Direction, rate: Direction, still: bool) -> None:
        force = math.hypot(*acc)
        if not self._begun:
            self._begun = True
            x, y, z = acc
            self._q = straight((x / force, y / force, z / force) if force else (0.0, 0.0, 1.0))
            return
        q = compose(self._q, from_vector(rate[0] * seconds, rate[1] * seconds, rate[2] * seconds))
        # A dead accelerometer shows no direction, and the gyroscope alone carries the attitude.
        if force:
            x, y, z = rotate(q, acc)
            aside = math.hypot(x, y)
            missing = math.atan2(aside, z)
            share = 1.0 - math.exp(-seconds / (STILL_S if still else MOVING_S))
            turn = min(share * missing, CORRECT_RAD_S * seconds) / aside if aside else 0.0
            q = compose(from_vector(y * turn, -x * turn, 0.0), q)
        if still and not self._levelled:
            w, x, y, z = q
            up = rotate((w, -x, -y, -z), (0.0, 0.0, 1.0))
            most, yaw = STRAIGHTEN_RAD_S * seconds, yaw_between(straight(up), q)
            q = compose(from_vector(0.0, 0.0, min(max(yaw, -most), most)), q)
        size = math.hypot(*q)
        w, x, y, z = q
        self._q = (w / size, x / size, y / size, z / size)


def from_vector(x: float, y: float, z: float) -> Quaternion:
    """Return the quaternion of a rotation vector [rad]."""
    half = 0.5 * math.hypot(x, y, z)
    scale = 0.5 * (math.sin(half) / half if half else 1.0)
    return (math.cos(half), scale * x, scale * y, scale * z)


def compose(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the turn q followed by the turn p."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def rotate(attitude: Quaternion, v: Direction) -> Direction:
    """Return the vector `v` of the board's axes in the room's."""
    w, x, y, z = attitude
    a, b, c = v
    # v + 2 w (q x v) + 2 q x (q x v)
    d, e, f = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * d + y * f - z * e),
        b + 2.0 * (w * e + z * d - x * f),
        c + 2.0 * (w * f + x * e - y * d),
    )


def yaw_between(attitude: Quaternion, other: Quaternion) -> float:
    """Return the turn about the vertical to one attitude from another [rad]."""
    w, x, y, z = other
    w, _, _, z = compose(attitude, (w, -x, -y, -z))
    return math.atan2(2.0 * w * z, w * w - z * z)


def turned_up(attitude: Quaternion, up: Direction) -> Quaternion:
    """Return an attitude after the shortest turn that points the unit vector `up` of the board's axes up."""
    x, y, z = rotate(attitude, up)
    size = math.hypot(1.0 + z, y, x)
    return compose(((1.0 + z) / size, y / size, -x / size, 0.0), attitude)


def straight(up: Direction) -> Quaternion:
    """Return the attitude nearest to a board laid straight in which the unit vector `up` of its axes points up."""
    # A board that lies on its component side was turned over about its x axis.
    return turned_up(LAID if up[2] >= 0.0 else (0.0, 1.0, 0.0, 0.0), up)


def canonical(q: Quaternion) -> Quaternion:
    """Return the quaternion of the same rotation with w >= 0."""
    w, x, y, z = q
    return (-w, -x, -y, -z) if w < 0.0 else q
