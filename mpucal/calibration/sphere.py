"""Directions: unit vectors spread over the sphere, and the plane across one."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from ..data import Vector


@cache
def fibonacci_sphere(n: int) -> Vector:
    """(n, 3) unit vectors spread evenly over the sphere."""
    k = np.arange(n) + 0.5
    z, turn = 1.0 - 2.0 * k / n, np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def tangents(u: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors (3,) that span the plane across the unit vector u."""
    x, y, z = u.tolist()
    # across the axis that u is farthest from; plain floats, as this runs in every step of a minimiser
    least = min(abs(x), abs(y), abs(z))
    first = (0.0, z, -y) if abs(x) == least else (-z, 0.0, x) if abs(y) == least else (y, -x, 0.0)
    size = math.hypot(*first)
    a, b, c = (value / size for value in first)
    return np.array([a, b, c]), np.array([y * c - z * b, z * a - x * c, x * b - y * a])
