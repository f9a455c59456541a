"""Coverage: which orientations the board has been in, how many, and whether they are spread over the sphere.

Directions are of the raw acceleration: bias and scale factor error bend them by a few degrees, which does no harm.
"""

from __future__ import annotations

import math

import numpy as np

from ..data import Vector

# Orientations count as different from here on: far enough for 12 of them to be far from parallel,
# near enough for a sphere to hold some seventy.
DISTINCT_RAD = math.radians(20.0)
# Without a pause a direction is seen only in passing, among the hand's accelerations: so many make up for a pause.
PASSES_OF_A_PAUSE = 4

# Rests so near one another are one.
SAME_RAD = math.radians(2.0)

# How evenly directions must be spread, against 1.0 for evenly over the whole sphere: what varied orientations
# exceed several times, while the six faces or tilts about one axis stay below by orders of magnitude.
SPREAD = 0.05
_UNIFORM = 2.0 / 15.0


class Directions:
    """Directions that differ from one another by `apart_rad`: `units`, (n, 3)."""

    def __init__(self, apart_rad: float = DISTINCT_RAD) -> None:
        self.units = np.zeros((0, 3))
        self._apart_rad = apart_rad

    def __len__(self) -> int:
        return len(self.units)

    def add(self, unit: Vector) -> bool:
        """Keep a unit vector (3,) unless one near it is there already; True where it was new."""
        if self.near(unit, self._apart_rad):
            return False
        self.units = np.vstack([self.units, unit])
        return True

    def near(self, unit: Vector, apart_rad: float) -> bool:
        """Whether one of them is less than `apart_rad` from a unit vector (3,)."""
        return bool(len(self)) and float((self.units @ unit).max()) > math.cos(apart_rad)

    def spread(self) -> float:
        """How well the directions alone would determine an ellipsoid, from 0 to 1 (as all directions).

        It is the smallest eigenvalue of the mean of p p', p the nine monomials of first and second degree,
        against that of the uniform sphere (2/15). It is zero where all directions lie on a cone or a plane,
        or on few axes, or where none tilts two axes together.
        """
        if not len(self):
            return 0.0
        p = _monomials(self.units)
        return float(np.linalg.eigvalsh(p.T @ p / len(p))[0]) / _UNIFORM


class Coverage:
    """Counts the orientations in which the board paused, and those it passed."""

    def __init__(self) -> None:
        self.paused = Directions()
        self.passed = Directions()
        self.rested = Directions(SAME_RAD)

    def passes(self, acc: Vector) -> bool:
        """The mean acceleration (3,) [m/s^2] of a short time; True where its direction is new."""
        return self.passed.add(_unit(acc))

    def pauses(self, acc: Vector) -> bool:
        """The mean acceleration (3,) [m/s^2] of a pause; True where its direction is new."""
        return self.paused.add(_unit(acc))

    def rests(self, acc: Vector) -> None:
        """The mean acceleration (3,) [m/s^2] of a rest, long or short, in a new orientation or near another."""
        self.rested.add(_unit(acc))

    def was_near(self, acc: Vector, apart_rad: float) -> bool:
        """Whether the board has rested less than `apart_rad` from where its mean acceleration (3,) is this."""
        return self.rested.near(_unit(acc), apart_rad)

    def is_new(self, acc: Vector) -> bool:
        """Whether a pause with the mean acceleration (3,) would be a new one."""
        return not self.paused.near(_unit(acc), DISTINCT_RAD)

    @property
    def number(self) -> int:
        """How many orientations there are, by pauses or by passes, whichever is more."""
        return max(len(self.paused), len(self.passed) // PASSES_OF_A_PAUSE)

    def farthest_down(self, candidates: Vector) -> Vector:
        """(3,) that of the unit vectors (k, 3) which, pointing down, is least like any pause."""
        return _farthest(candidates, self.paused)

    def farthest_from_rests(self, candidates: Vector) -> Vector:
        """(3,) likewise of all rests."""
        return _farthest(candidates, self.rested)

    @property
    def varied(self) -> bool:
        """Whether they are spread over the sphere."""
        return max(self.paused.spread(), self.passed.spread()) >= SPREAD


def _farthest(candidates: Vector, ups: Directions) -> Vector:
    return np.asarray(candidates[int((-candidates @ ups.units.T).max(1).argmin())])


def _unit(acc: Vector) -> Vector:
    return acc / max(float(np.linalg.norm(acc)), 1e-9)


def _monomials(u: Vector) -> Vector:
    """(n, 9) of (n, 3); the factor makes the second-degree ones orthogonal over the sphere."""
    x, y, z = u.T
    r = math.sqrt(2.0)
    return np.stack([x * x, y * y, z * z, r * x * y, r * x * z, r * y * z, x, y, z], axis=1)
