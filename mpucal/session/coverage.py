"""Which orientations the board has been in, whether they are enough, and which one would help most.

Knows raw accelerometer directions only: a bias or a gain bends them by some degrees, which does no harm here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Vector

# Orientations count as different from here on: far enough for 12 of them to be far from parallel,
# near enough for a sphere to hold some seventy.
DISTINCT_RAD = math.radians(20.0)
# Ten to twelve pauses determine D to a few 1e-4; each further one adds little.
PAUSES = 12
# Without a pause a direction is seen only in passing, among the hand's accelerations:
# most of the sphere (half a minute or more of turning about all axes) then makes up for the pauses.
PASSES = 48

# How evenly directions must be spread, against 1.0 for evenly over the whole sphere: what varied orientations
# exceed several times, while the six faces or tilts about one axis stay below by orders of magnitude.
SPREAD = 0.05
_UNIFORM = 2.0 / 15.0


class Directions:
    """Directions that differ from one another."""

    def __init__(self) -> None:
        self._units = np.zeros((0, 3))

    def __len__(self) -> int:
        return len(self._units)

    def add(self, unit: Vector) -> bool:
        """Keep a unit vector (3,) unless one near it is there already; True where it was new."""
        if len(self) and float((self._units @ unit).max()) > math.cos(DISTINCT_RAD):
            return False
        self._units = np.vstack([self._units, unit])
        return True

    def spread(self) -> float:
        """How well the directions alone would determine an ellipsoid, from 0 to 1 (as all directions).

        It is the smallest eigenvalue of the mean of p p', p the nine monomials of first and second degree,
        against that of the uniform sphere (2/15). It is zero where all directions lie on a cone or a plane,
        or on few axes, or where none tilts two axes together.
        """
        if not len(self):
            return 0.0
        p = _monomials(self._units)
        return float(np.linalg.eigvalsh(p.T @ p / len(p))[0]) / _UNIFORM

    def most_wanted(self) -> Vector:
        """(3,) the unit vector that would add most to what the directions determine."""
        p = _monomials(self._units)
        information = p.T @ p + 1e-3 * np.eye(9)
        candidates = _monomials(_SPHERE)
        gain = np.einsum("ki,ij,kj->k", candidates, np.linalg.inv(information), candidates)
        return np.asarray(_SPHERE[int(gain.argmax())])


@dataclass(frozen=True)
class Count:
    """How many orientations of how many, whether that is enough, and the direction (3,) that helps most."""

    done: int
    of: int
    enough: bool
    wanted: Vector


class Coverage:
    """Counts the orientations in which the board paused, and those it passed."""

    def __init__(self) -> None:
        self.paused = Directions()
        self.passed = Directions()

    def passes(self, acc: Vector) -> bool:
        """The mean acceleration (3,) [m/s^2] of a short time; True where its direction is new."""
        return self.passed.add(_unit(acc))

    def pauses(self, acc: Vector) -> bool:
        """The mean acceleration (3,) [m/s^2] of a pause; True where its direction is new."""
        return self.paused.add(_unit(acc))

    def count(self) -> Count:
        """How far it is, by pauses or by passes, whichever is further."""
        by_pauses, by_passes = len(self.paused) / PAUSES, len(self.passed) / PASSES
        directions = self.paused if by_pauses >= by_passes else self.passed
        share = max(by_pauses, by_passes)
        enough = share >= 1.0 and directions.spread() >= SPREAD
        done = min(int(PAUSES * share + 1e-9), PAUSES)
        return Count(done, PAUSES, enough, directions.most_wanted())


def _unit(acc: Vector) -> Vector:
    return acc / max(float(np.linalg.norm(acc)), 1e-9)


def _monomials(u: Vector) -> Vector:
    """(n, 9) of (n, 3); the factor makes the second-degree ones orthogonal over the sphere."""
    x, y, z = u.T
    r = math.sqrt(2.0)
    return np.stack([x * x, y * y, z * z, r * x * y, r * x * z, r * y * z, x, y, z], axis=1)


def _sphere(n: int) -> Vector:
    """(n, 3) unit vectors, evenly over the sphere (a Fibonacci lattice)."""
    k = np.arange(n) + 0.5
    z = 1.0 - 2.0 * k / n
    angle = math.pi * (1.0 + math.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


_SPHERE = _sphere(200)
