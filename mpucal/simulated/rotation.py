"""Unit quaternions (w, x, y, z), arrays of them, from the board's axes to the world's."""

from __future__ import annotations

import sys

import numpy as np

from ..data import Vector


def product(p: Vector, q: Vector) -> Vector:
    """Return the quaternions p q of (..., 4) and (..., 4): first q, then p."""
    if p.ndim == 1:
        w, x, y, z = p.tolist()
        return np.asarray(q @ np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]))
    pw, px, py, pz = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
    qw, qx, qy, qz = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    pq = np.empty(np.broadcast_shapes(p.shape, q.shape), order="F")
    pq[..., 0] = pw * qw - px * qx - py * qy - pz * qz
    pq[..., 1] = pw * qx + px * qw + py * qz - pz * qy
    pq[..., 2] = pw * qy - px * qz + py * qw + pz * qx
    pq[..., 3] = pw * qz + px * qy - py * qx + pz * qw
    return pq


def exp(turn_rad: Vector) -> Vector:
    """Return the quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    half = 0.5 * np.asarray(turn_rad)
    angle = np.maximum(_norm(half), sys.float_info.min)  # not 0, by which nothing can be divided
    q = np.empty((*half.shape[:-1], 4), order="F")
    q[..., 0] = np.cos(angle)
    q[..., 1:] = half * (np.sin(angle) / angle)[..., None]
    return q


def log(q: Vector) -> Vector:
    """Return the shortest rotation vectors (..., 3) [rad] of quaternions (..., 4)."""
    w, v = q[..., 0], q[..., 1:]
    sine = np.maximum(_norm(v), sys.float_info.min)
    return np.asarray(v * (np.copysign(2.0, w) * np.arctan2(sine, np.abs(w)) / sine)[..., None])


def _norm(v: Vector) -> Vector:
    """Return the lengths (...) of (..., 3), in half the time of np.linalg.norm."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def conjugate(q: Vector) -> Vector:
    """Return the inverse of each of (..., 4)."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def between(q: Vector) -> Vector:
    """Return the rotation vectors (n, 3) [rad] from each of (n + 1, 4) to the next, in the axes of the first."""
    return log(product(conjugate(q[:-1]), q[1:]))


def running_product(start: Vector, steps: Vector) -> Vector:
    """Return start, start s_0, start s_0 s_1, ...: (n + 1, 4) of (n, 4), each normalised.

    The stride doubles, so that a thousand steps are ten passes of NumPy.
    """
    q = np.concatenate((start[None], steps))
    stride = 1
    while stride < len(q):
        q[stride:] = product(q[:-stride], q[stride:])
        stride *= 2
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def up_in_board(q: Vector) -> Vector:
    """Return the world's up in the board's axes: (..., 3), the last row of R(q)."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    up = np.empty((*q.shape[:-1], 3), order="F")
    up[..., 0] = 2 * (x * z - w * y)
    up[..., 1] = 2 * (y * z + w * x)
    up[..., 2] = w * w - x * x - y * y + z * z
    return up
