"""Coverage: the orientations that the board has been in, and their spread over the sphere.

Directions are those of the raw acceleration: bias and scale factor errors bend them by a few degrees, which does no
harm.
"""

from __future__ import annotations

import math

import numpy as np

from ..data import Vector

# Orientations this far apart count as different: 12 of them are far from parallel, and a sphere holds some seventy.
DISTINCT_RAD = math.radians(20.0)
# A direction that was only passed is disturbed by the hand's accelerations: so many count as one pause.
PASSES_OF_A_PAUSE = 4
# Rests nearer to one another count as one.
SAME_RAD = math.radians(2.0)

# Least spread of the directions, where 1.0 is evenly over the sphere. Varied orientations exceed it several times; the
# six faces, or tilts about one axis, stay below it by orders of magnitude.
SPREAD = 0.05


class Directions:
    """Directions of accelerations, `apart_rad` or more from one another: unit vectors `units` (n, 3)."""

    def __init__(self, apart_rad: float = DISTINCT_RAD) -> None:
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
    """Orientations that the board has paused in, passed, and rested in, long or short.

    Attributes
    ----------
    placed : True if nobody touched it in the pauses so far: it is put down in each orientation.
    """

    placed = False

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
