"""The board as a rigid body: its attitude, and the acceleration of a point on it."""

import numpy as np

from mpucal.calibration.rotation import cross
from mpucal.data import Vector
from mpucal.simulated import rotation
from mpucal.simulated.disturbance import point_acceleration

# the board's axes are the world's
LEVEL = rotation.exp(np.zeros(3))


def attitudes(omega: Vector, step_s: float, start: Vector = LEVEL) -> Vector:
    """Return quaternions (n + 1, 4) from `start` (4,) on, turned by omega (n, 3) [rad/s] for step_s each."""
    return rotation.running_product(start, rotation.exp(step_s * omega))


def board_from_world(q: Vector) -> Vector:
    """Return R(x) of equation (3), (..., 3, 3), from the world's axes to the board's, of quaternions (..., 4)."""
    V = cross(q[..., 1:])
    return np.asarray(np.eye(3) + 2.0 * (V @ V - q[..., 0, None, None] * V))


def lever_acceleration(omega: Vector, r: Vector, step_s: float) -> Vector:
    """Return the acceleration (n, 3) [m/s^2] in the body of a point r (n, 3) [m] of it, itself moving or not."""
    alpha, v = np.gradient(omega, step_s, axis=0), np.gradient(r, step_s, axis=0)
    return np.asarray(point_acceleration(alpha, omega, r, v) + np.gradient(v, step_s, axis=0))


def specific_force(q: Vector, gravity: float, world: Vector) -> Vector:
    """Return gravity and an acceleration of the world (n, 3) [m/s^2] in the board's axes, in each of the steps.

    q : (n + 1, 4) the attitude at the ends of the steps.
    """
    up = rotation.up_in_board(q)
    force = 0.5 * gravity * (up[:-1] + up[1:])
    if world.any():
        force += (board_from_world(0.5 * (q[:-1] + q[1:])) @ world[..., None])[..., 0]
    return np.asarray(force)
