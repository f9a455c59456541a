"""The board as a rigid body: attitude from rates, and what a sensor on it feels."""

from __future__ import annotations

import numpy as np

from mpucal.data import Vector
from mpucal.simulated import rotation
from tools.lab.scenarios.shaking import lever_acceleration

# steps multiplied out one after the other in each of the blocks that go side by side
BLOCK = 256


def attitudes(omega: Vector, step_s: float, start: Vector) -> Vector:
    """Return quaternions (n + 1, 4) from `start` (4,) on, turned by omega (n, 3) [rad/s] for step_s each."""
    n = len(omega)
    blocks = -(-n // BLOCK)
    turns = np.zeros((blocks * BLOCK, 3))
    turns[:n] = step_s * omega
    q = rotation.exp(turns).reshape(blocks, BLOCK, 4).swapaxes(0, 1).copy()
    for k in range(1, BLOCK):
        q[k] = rotation.product(q[k - 1], q[k])
    first = rotation.running_product(start, q[-1])[:-1]
    return np.concatenate((start[None], rotation.product(first, q).swapaxes(0, 1).reshape(-1, 4)[:n]))


def in_board(q: Vector, world: Vector) -> Vector:
    """Return vectors (n, 3) of the world in axes of boards of attitude q (n, 4): v - 2 w (u x v) + 2 u x (u x v)."""
    w, u = q[:, :1], q[:, 1:]
    across = np.cross(u, world)
    return np.asarray(world - 2.0 * w * across + 2.0 * np.cross(u, across))


def specific_force(q: Vector, omega: Vector, step_s: float, gravity: float, lever_m: Vector, world: Vector) -> Vector:
    """Return what a sensor feels (n, 3) [m/s^2] in each step, in the axes of the board.

    Parameters
    ----------
    q : (n + 1, 4) the attitude at the ends of the steps. omega : (n, 3) rad/s.
    lever_m : (n, 3) the sensor's place from the pivot, in the body. world : (n, 3) m/s^2, the pivot's acceleration.
    """
    up = rotation.up_in_board(q)
    force = 0.5 * gravity * (up[:-1] + up[1:])
    if world.any():
        force += in_board(0.5 * (q[:-1] + q[1:]), world)
    if lever_m.any():
        force += lever_acceleration(omega, lever_m, step_s)
    return np.asarray(force)
