"""The targets of a session (standard uncertainty, 1 sigma), and orientations: those seen, and those it may ask for.

Directions are those of the raw acceleration: bias and scale factor errors bend them by a few degrees, which does no
harm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from ..data import Sensor, Vector
from ..origin import Origin
from ..rests.limits import ENOUGH_ORIENTATIONS, LEAST_TURN_RAD
from .events import Direction, Target

# The hand's accelerations disturb a direction that was only passed: this number of passes counts as one pause.
PASSES_OF_A_PAUSE = 4
# Rests nearer to one another count as one.
SAME_RAD = math.radians(2.0)

# Least spread of the directions, where 1.0 is evenly over the sphere. Varied orientations exceed it several times; the
# six faces, or tilts about one axis, stay below it by orders of magnitude.
SPREAD = 0.05


class Directions:
    """Directions of accelerations, `apart_rad` or more from one another: unit vectors `units` (n, 3)."""

    def __init__(self, apart_rad: float = LEAST_TURN_RAD) -> None:
        self.units = np.zeros((0, 3))
        self._apart_rad = apart_rad

    def __len__(self) -> int:
        return len(self.units)

    def add(self, acc: Vector) -> bool:
        """Keep the direction of a mean acceleration (3,), unless one near it is there; return True if it was new."""
        if self.near(acc):
            return False
        self.units = np.vstack([self.units, _unit(acc)])
        return True

    def near(self, acc: Vector, apart_rad: float | None = None) -> bool:
        """Return True if one of them is less than `apart_rad` (None: that of `add`) from that of `acc` (3,)."""
        apart_rad = self._apart_rad if apart_rad is None else apart_rad
        return bool(len(self)) and float((self.units @ _unit(acc)).max()) > math.cos(apart_rad)

    def farthest_down(self, candidates: Vector) -> Vector:
        """Return that of the unit vectors (k, 3) which, pointing down, differs most from all directions here."""
        return np.asarray(candidates[int((-candidates @ self.units.T).max(1).argmin())])

    def spread(self) -> float:
        """Return how well the directions alone would determine an ellipsoid, from 0 to 1 (as all directions).

        It is the smallest eigenvalue of the mean of p p', p the nine monomials of first and second degree, divided by
        that of the uniform sphere (2/15). It is zero where all directions lie on a cone or a plane, or on few axes, or
        where none tilts two axes together.
        """
        if not len(self):
            return 0.0
        p = _monomials(self.units)
        return float(np.linalg.eigvalsh(p.T @ p / len(p))[0]) / (2.0 / 15.0)


class Coverage:
    """Orientations in which the board has paused or rested (a rest may be shorter), and those that it has passed."""

    def __init__(self) -> None:
        self.paused, self.passed, self.rested = Directions(), Directions(), Directions(SAME_RAD)

    @property
    def number(self) -> int:
        """Number of orientations, by pauses or by passes, whichever is more."""
        return max(len(self.paused), len(self.passed) // PASSES_OF_A_PAUSE)

    @property
    def varied(self) -> bool:
        """True if the orientations are spread over the sphere."""
        return max(self.paused.spread(), self.passed.spread()) >= SPREAD


def _unit(acc: Vector) -> Vector:
    return acc / max(float(np.linalg.norm(acc)), 1e-9)


def _monomials(u: Vector) -> Vector:
    """Return (n, 9) of (n, 3); the factor makes those of second degree orthogonal over the sphere."""
    x, y, z = u.T
    r = math.sqrt(2.0)
    return np.stack([x * x, y * y, z * z, r * x * y, r * x * z, r * y * z, x, y, z], axis=1)


_corners = np.array([c for c in product((-1.0, 0.0, 1.0), repeat=3) if any(c)])
# (26, 3) unit vectors: the faces, edges and corners of a cube, which a person can name and find
ALL_AROUND: Vector = _corners / np.linalg.norm(_corners, axis=1, keepdims=True)
TILT_RAD = math.radians(30.0)
# An orientation verifies if it is LEAST_TURN_RAD from all that the fit has seen. Small tilts leave less room.
UNSEEN_TILT_RAD = math.radians(10.0)


# Rest after which noise and gyroscope bias are known, and the least one after which a person may go on. The second is
# enough for a vehicle: an autopilot has estimated the gyroscope's bias when it started, and each rest on a side shows
# what is left of it.
FLAT_S, SHORTEST_FLAT_S = 10.0, 2.0


class Aim(NamedTuple):
    """Conditions for the end of each step, and the number of verifications.

    Attributes
    ----------
    target : standard uncertainties (1 sigma). least : orientations that must have been seen, whatever the target.
    longest_s : time limit of the turning [s]. verify : number of new orientations for the verification.
    flat_s : time for which the board lies flat first. by_sides : ask for SIDES first.
    """

    target: Target
    least: int
    longest_s: float
    verify: int
    flat_s: float = FLAT_S
    by_sides: bool = False


QUICK, NORMAL, BEST = "quick", "normal", "best"
AIMS: Mapping[str, Aim] = {
    QUICK: Aim(Target(0.3, 0.15, 3.0), least=8, longest_s=60.0, verify=2),
    NORMAL: Aim(Target(0.1, 0.05, 1.0), least=ENOUGH_ORIENTATIONS, longest_s=120.0, verify=3),
    BEST: Aim(Target(0.04, 0.02, 0.4), least=14, longest_s=240.0, verify=3),
}
# Directions that point down as a vehicle lies on its sides: level, left side, nose down, back, right side, nose up.
# Each is a quarter turn from the one before, about a different axis. They determine biases and scale factors best, and
# a vehicle's parameters hold no more. The last direction is tilted: with the gyroscope it gives the angles between the
# axes.
SIDES: Vector = np.array([(0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 0, -1), (0, 1, 0), (-1, 0, 0), (0, -1, 1)], np.float64)
SIDES /= np.linalg.norm(SIDES, axis=1, keepdims=True)
# One new orientation verifies a first calibration that is good. If its verdict is only usable, a slip may be the
# reason, and as many orientations are needed as for the quickest calibration of a board.
VERIFY_GOOD = 1


def select_aim(target: str, sensor: Sensor | None = None) -> Aim:
    """Return the aim of a target, one of AIMS; a vehicle lies flat for less, and is turned onto its sides."""
    aim = AIMS[target]
    if sensor is None or sensor.origin is not Origin.VEHICLE:
        return aim
    of_board = aim.target
    # A vehicle's parameters hold no angles between the axes, which need only be known well enough for the biases.
    std = Target(of_board.gain_pct, 6.0 * of_board.misalignment_deg, 0.7 * of_board.bias_mg)
    aim = aim._replace(target=std, flat_s=SHORTEST_FLAT_S, by_sides=True)
    # The best target takes as many orientations as that of a board.
    return aim if target == BEST else aim._replace(least=len(SIDES), verify=VERIFY_GOOD)


def unseen_rad(tilt_only: bool) -> float:
    """Return the least angle [rad] from all orientations seen at which one counts for the verification."""
    return UNSEEN_TILT_RAD if tilt_only else LEAST_TURN_RAD


def directions(flat_down: Direction, tilt_only: bool) -> Vector:
    """Return unit vectors (k, 3) that the board may be asked to point down.

    Parameters
    ----------
    flat_down : points down while the board lies flat. tilt_only : stay within TILT_RAD of it.
    """
    if not tilt_only:
        return ALL_AROUND
    down = np.asarray(flat_down, float)
    first = np.cross(down, np.eye(3)[int(np.argmin(np.abs(down)))])
    first /= np.linalg.norm(first)
    second = np.cross(down, first)
    around = np.arange(8) * math.pi / 4.0
    across = np.cos(around)[:, None] * first + np.sin(around)[:, None] * second
    return np.vstack([down, math.cos(TILT_RAD) * down + math.sin(TILT_RAD) * across])
