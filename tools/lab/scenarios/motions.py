"""Motions of a simulated hand that turns a board: angular rates over time.

A motion gives omega (n, 3) [rad/s] in the body at the times t (n,) [s], and how much the hand moves then (n,), 0 to 1.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mpucal.data import Vector
from mpucal.simulated import rotation
from mpucal.simulated.legs import minimum_jerk_rate

FLAT_S, MOVING_S = 10.0, 40.0
CHECK_S = 15.0
APART_RAD = np.radians(25.0)
SLOPPY_RAD = np.radians(8.0)


def plateau(t: Vector, start: float, end: float, ramp: float) -> Vector:
    """Return 1 between start and end [s], 0 outside, with smooth ramps inside that take `ramp` s."""
    rise, fall = (np.clip(x / ramp, 0.0, 1.0) for x in (t - start, end - t))
    shape: Vector = (rise * fall) ** 2 * (3 - 2 * rise) * (3 - 2 * fall)
    return shape


def moves(t: Vector, turns: Vector, durations: Vector, starts: NDArray[np.floating]) -> tuple[Vector, Vector]:
    """Return omega (n, 3) and moving (n,) of separate moves by rotation vectors turns (m, 3) [rad]."""
    omega, moving = np.zeros((len(t), 3)), np.zeros(len(t))
    for turn, duration, start in zip(turns, durations, starts, strict=True):
        omega += minimum_jerk_rate((t - start) / duration)[:, None] / duration * turn
        moving += plateau(t, start, start + duration, ramp=0.2)
    return omega, moving


def poses(t: Vector, rng: np.random.Generator, n: int) -> tuple[Vector, Vector]:
    """Draw n still orientations, the flat one among them, by moves of 50 to 130 deg about x, y, z in turn."""
    m = n - 1
    about = np.eye(3)[np.arange(m) % 3] * rng.choice([-1.0, 1.0], m)[:, None]
    turns = about * np.radians(rng.uniform(50, 130, m))[:, None] + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (m, 3))
    return moves(t, turns, np.full(m, 1.6), FLAT_S + MOVING_S / m * np.arange(m))


def three_orientations(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw three still orientations in 15 s, each 25 deg or more from the others and from flat, as for a check."""
    while True:
        axis = rng.standard_normal((3, 3))
        axis[0, 2] = 0.0  # a turn about the vertical is none
        turns = np.radians(rng.uniform(40, 110, 3))[:, None] * axis / np.linalg.norm(axis, axis=1, keepdims=True)
        board = rotation.board_from_world(rotation.running_product(np.array([1.0, 0, 0, 0]), rotation.exp(turns)))
        up = board[..., 2]
        if (up @ up.T - 2.0 * np.eye(4)).max() < np.cos(APART_RAD):
            return moves(t, turns, np.full(3, 1.6), FLAT_S + CHECK_S / 3 * np.arange(3))


def as_asked(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw the three that a check asks for, each missed by some degrees: two edges of a box, and one across both."""
    up = np.array([[0, 0, 1], [1, 1, 0], [-1, 1, 0], [0, -1, -1]]) / np.sqrt([[1], [2], [2], [2]])
    turns = np.array([rotation.shortest_turn(after, before) for before, after in pairwise(up)])
    turns += rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (3, 3))
    return moves(t, turns, np.full(3, 1.6), FLAT_S + CHECK_S / 3 * np.arange(3))


def six_faces(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw the six faces of a box, by moves of 90 or 180 deg."""
    turns = np.pi / 2 * np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 2]])
    turns = turns + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, turns.shape)
    return moves(t, turns, np.full(5, 2.0), FLAT_S + MOVING_S / 5 * np.arange(5))


def three_turns(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw a complete turn about each axis, 12 s each, 1 s apart."""
    turns = 2 * np.pi * np.eye(3) + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (3, 3))
    return moves(t, turns, np.full(3, 12.0), FLAT_S + 13.0 * np.arange(3))


def continuous(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw six sines an axis at 0.08 to 0.7 Hz, 80 deg/s rms, until the end."""
    frequency, phase = rng.uniform(0.08, 0.7, (6, 3)), rng.uniform(0.0, 2 * np.pi, (6, 3))
    weight = rng.uniform(0.5, 1.0, (6, 3))
    since = np.maximum(t - FLAT_S, 0.0)
    omega = sum(
        w * np.sin(2 * np.pi * f * since[:, None] + p) for w, f, p in zip(weight, frequency, phase, strict=True)
    )
    moving = plateau(t, FLAT_S, np.inf, ramp=1.0)
    omega *= moving[:, None]
    rms: Vector = np.sqrt((omega[t >= FLAT_S] ** 2).mean(0))
    return omega * np.radians(80.0) / rms, moving


def attitude(omega: Vector, step_s: float, start_rad: Vector | None = None) -> Vector:
    """Return R(x_t) of equation (3) before each step of step_s with omega (n, 3), and after the last: (n + 1, 3, 3).

    start_rad : (3,) the turn that took the world's axes to the board's at first; None: none.
    """
    start = rotation.exp(np.zeros(3) if start_rad is None else start_rad)
    return rotation.board_from_world(rotation.running_product(start, rotation.exp(step_s * omega)))
