"""Rotations and directions: rotation vectors as matrices, turns in succession, unit vectors over the sphere."""

from __future__ import annotations

import math
from functools import cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
from ..kernel import _kernel
from ..result.correlation import UPPER


def lengths(v: Vector) -> NDArray[np.float64]:
    """Return the lengths (n,) of vectors (n, 3)."""
    return _kernel.lengths(v)


def units(v: Vector) -> NDArray[np.float64]:
    """Return vectors (n, 3) as unit vectors; one of no length stays 0."""
    return np.asarray(v / np.maximum(lengths(v), 1e-9)[:, None])


def cross_rows(u: Vector, v: Vector) -> NDArray[np.float64]:
    """Return u x v of (n, 3) and (n, 3) or (3,), by columns, which takes a third of np.cross's time."""
    (a, b, c), (x, y, z) = u.T, v.T
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)


def cross(v: Vector) -> NDArray[np.float64]:
    """Return [v]x, the matrix of the cross product: (..., 3) -> (..., 3, 3)."""
    matrix = np.zeros((*v.shape[:-1], 3, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return matrix - np.swapaxes(matrix, -1, -2)


def rotation(phi: Vector) -> NDArray[np.float64]:
    """Return exp([phi]x), the rotation by the vector phi [rad]: (..., 3) -> (..., 3, 3)."""
    if phi.ndim == 1:
        return _rotation(phi)
    angle2 = np.sum(phi * phi, axis=-1)[..., None, None]
    angle = np.sqrt(angle2)
    X = cross(phi)
    # Both coefficients are finite at zero.
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    turn: NDArray[np.float64] = np.eye(3) + a * X + b * (X @ X)
    return turn


def _rotation(phi: Vector) -> NDArray[np.float64]:
    """Return the rotation by one vector (3,), equal to the last bit; a session asks for thousands of them."""
    x, y, z = phi.tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    X = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    half = _sinc(0.5 * angle)
    turn: NDArray[np.float64] = np.eye(3) + _sinc(angle) * X + 0.5 * (half * half) * (X @ X)
    return turn


def _sinc(angle: float) -> float:
    # These are the steps of np.sinc, with its sine, so that the bits are equal.
    argument = math.pi * (angle / math.pi)
    return float(np.sin(argument)) / argument if argument else 1.0


def turned(phi: Vector, runs: NDArray[np.intp]) -> Vector:
    """Return exp([phi_last-1]x) ... exp([phi_first]x), (k, 3, 3), of runs (k, 2) of vectors phi (n, 3) [rad]."""
    return _kernel.turn(phi, runs)[0]


def turn_by_matrix(steps: Vector, K: Vector, runs: NDArray[np.intp]) -> tuple[Vector, Vector]:
    """Return turns (k, 3, 3), and their derivatives (k, 3, 6) [rad] by the upper triangle of the gyroscope's K.

    The derivatives are rotation vectors in the axes of a turn's end.

    steps : (n, 3) rad, of the gyroscope without K. runs : (k, 2) of them, first and last + 1 of each turn.
    """
    F, arrived = _kernel.turn(-steps @ K.T, runs, steps)
    by_K = -arrived - np.swapaxes(arrived, 2, 3) * (1.0 - np.eye(3))
    return F, by_K[:, :, *UPPER]


def sides_down(s: Vector) -> NDArray[np.intp]:
    """Return (n,) 0 to 5, the axis nearest to each specific force s (n, 3), with its sign."""
    axis = np.abs(s).argmax(axis=1)
    return np.asarray(2 * axis + (s[np.arange(len(s)), axis] > 0.0), np.intp)


def shortest_turns(a: Vector, b: Vector) -> NDArray[np.float64]:
    """Return the rotation vectors (n, 3) [rad] that take unit vectors a to b, (n, 3) each."""
    axis = cross_rows(a, b)
    angle = np.arctan2(lengths(axis), np.sum(a * b, axis=1))
    back = angle > math.pi - 1e-6  # about any axis across
    axis[back] = cross_rows(a[back], np.eye(3)[np.abs(a[back]).argmin(axis=1)])
    return np.asarray(units(axis) * angle[:, None])


@cache
def signed_permutations() -> list[Vector]:
    """Return all (3, 3) that map axes to axes, with either sign."""
    signs, order = product((1.0, -1.0), repeat=3), permutations(range(3))
    return [np.eye(3)[list(axes)] * np.array(sign)[:, None] for axes, sign in product(order, signs)]


@cache
def fibonacci_sphere(n: int = 400) -> Vector:
    """Return (n, 3) unit vectors spread evenly over the sphere."""
    k = np.arange(n) + 0.5
    z, turn = 1.0 - 2.0 * k / n, np.pi * (1.0 + np.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)


def tangents(u: Vector) -> tuple[Vector, Vector]:
    """Return two unit vectors (3,) that span the plane perpendicular to the unit vector u."""
    x, y, z = u.tolist()
    # The first is perpendicular to the axis farthest from u. Plain floats are fast, and each minimiser step runs this.
    least = min(abs(x), abs(y), abs(z))
    first = (0.0, z, -y) if abs(x) == least else (-z, 0.0, x) if abs(y) == least else (y, -x, 0.0)
    size = math.hypot(*first)
    a, b, c = (value / size for value in first)
    return np.array([a, b, c]), np.array([y * c - z * b, z * a - x * c, x * b - y * a])
