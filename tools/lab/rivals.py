"""Rival calibrations of the same recording: six positions, and an ellipsoid.

All work on the rests of a recording. Each returns an Estimate, or raises Unfit with the sentence that says why the
data do not suit it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from mpucal.calibration.masks import with_masks
from mpucal.calibration.rotation import cross, rotation, turned
from mpucal.data import Recording, Vector
from mpucal.rests.flat import Flat, find_flat, flat_statistics
from mpucal.rests.intervals import Intervals, RestFinder

FACE_RAD = np.deg2rad(25.0)  # limit of a face's angle from the vertical: a large bias tilts the measurement
LONGEST_MOVE_S = 20.0
FEWEST_POSES, WORST_CONDITION = 9, 1e4
STEPS = 30
SHORTEST_S = 1.0


class Unfit(Exception):  # noqa: N818 - reads as the sentence it is
    """Recording that lacks what a method needs, as the message says."""


@dataclass(frozen=True)
class Estimate:
    """y = D s + b_a, in m/s^2."""

    D: Vector
    b_a: Vector


@dataclass(frozen=True)
class Rests:
    """A recording with its flat segment's statistics and the runs in which it rests for a second and more."""

    recording: Recording
    flat: Flat
    runs: Intervals

    @classmethod
    def of(cls, recording: Recording) -> Rests:
        """Find the rests of a recording.

        Raises
        ------
        Unfit : the board never lies still.
        """
        recording = with_masks(recording)
        segment = recording.flat or find_flat(recording)
        if segment is None:
            raise Unfit("never still")
        flat = flat_statistics(recording, segment)
        runs = RestFinder(recording, flat).typical()
        return cls(recording, flat, runs[runs[:, 1] - runs[:, 0] >= SHORTEST_S * recording.rate_hz])

    @cached_property
    def y(self) -> Vector:
        """Return the accelerometer's means (k, 3) [m/s^2]."""
        return np.array([self.recording.acc[a:b].mean(0) for a, b in self.runs]).reshape(-1, 3)

    @cached_property
    def b_omega(self) -> Vector:
        """Return the gyroscope's means (k, 3) [rad/s]."""
        return np.array([self.recording.gyr[a:b].mean(0) for a, b in self.runs]).reshape(-1, 3)

    def moves(self) -> list[tuple[int, Vector]]:
        """Return (k, F) of each short move: F (3, 3) carries a vector of the body at rest k to that at k + 1."""
        r = self.recording
        moves = []
        for k, ((_, a), (b, _)) in enumerate(pairwise(self.runs.tolist())):
            if r.t[b] - r.t[a - 1] <= LONGEST_MOVE_S:
                rate = r.gyr[a - 1 : b] - self.b_omega[k : k + 2].mean(0)
                steps = -np.diff(r.t[a - 1 : b + 1])[:, None] * rate
                moves.append((k, turned(steps, np.array([[0, len(steps)]]))[0]))
        return moves


def six_positions(rests: Rests, gravity: float) -> Estimate:
    """Estimate scale factors and biases, each axis by itself, from six faces, as most instructions for hobbyists do."""
    up, down = (np.diag([rests.y[k] for k in faces(rests)[i::2]]) for i in (0, 1))
    return Estimate(np.diag((up - down) / (2.0 * gravity)), (up + down) / 2.0)


def ellipsoid(rests: Rests, gravity: float) -> Estimate:
    """Find nine parameters from magnitudes alone: the sensor's frame against the gyroscope's stays unknown.

    T, upper triangular, and b_a minimise the sum of (|T (y - b_a)| - g)^2 over the rests.
    """
    if len(rests.y) < FEWEST_POSES:
        raise Unfit(f"{len(rests.y)} rests, needs {FEWEST_POSES}")
    upper = np.triu_indices(3)
    T, b = gravity / np.median(np.linalg.norm(rests.y, axis=1)) * np.eye(3), np.zeros(3)
    for _ in range(STEPS):
        y = rests.y - b
        z = y @ T.T
        length = np.linalg.norm(z, axis=1)
        unit = z / length[:, None]
        # in units of g, the columns of T and of b are of one size
        J = np.hstack([unit[:, upper[0]] * y[:, upper[1]] / gravity, -unit @ T])
        condition = float(np.linalg.cond(J))
        if not condition < WORST_CONDITION:
            raise Unfit("the rests' orientations leave the ellipsoid open")
        step = np.linalg.lstsq(J, gravity - length, rcond=None)[0]
        T[upper] += step[:6] / gravity
        b = b + step[6:]
    if not (np.isfinite(T).all() and np.abs(step).max() < 1e-6 and np.linalg.det(T) > 0):
        raise Unfit(f"does not converge (condition {condition:.0f})")
    return Estimate(np.linalg.inv(T), b)


def aligned_ellipsoid(rests: Rests, gravity: float) -> Estimate:
    """Find the ellipsoid, turned by the Q that makes the gyroscope carry gravity best from rest to rest."""
    free = ellipsoid(rests, gravity)
    moves = rests.moves()
    if len(moves) < 2:
        raise Unfit("fewer than two moves between rests")
    s = (rests.y - free.b_a) @ np.linalg.inv(free.D).T / gravity
    Q = np.eye(3)
    for _ in range(STEPS):
        u = s @ Q.T
        miss = np.concatenate([u[k + 1] - F @ u[k] for k, F in moves])
        J = np.concatenate([F @ cross(u[k]) - cross(u[k + 1]) for k, F in moves])
        phi = np.linalg.lstsq(J, -miss, rcond=None)[0]
        Q = rotation(phi) @ Q
    return Estimate(free.D @ Q.T, free.b_a)


def faces(rests: Rests) -> list[int]:
    """Return the rests nearest to +x, -x, +y, -y, +z, -z up."""
    u = rests.y / np.linalg.norm(rests.y, axis=1, keepdims=True)
    found, missing = [], []
    for axis in range(3):
        for sign in (1.0, -1.0):
            nearest = int(np.argmax(sign * u[:, axis]))
            found.append(nearest)
            if sign * u[nearest, axis] < np.cos(FACE_RAD):
                missing.append(f"{'+' if sign > 0 else '-'}{'xyz'[axis]}")
    if missing:
        raise Unfit(f"no rest with {', '.join(missing)} up")
    return found
