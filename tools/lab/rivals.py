"""Rival calibrations of the same recording: six positions, an ellipsoid, imucal.

All work on the rests of a recording. Each returns an Estimate, or raises Unfit with the sentence that says why the
data do not suit it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from mpucal.calibration.masks import with_masks
from mpucal.calibration.rotation import cross, rotation, turned
from mpucal.data import Recording, Vector
from mpucal.rests.flat import Flat, find_flat, flat_statistics
from mpucal.rests.intervals import Intervals, RestFinder

FACE_RAD = np.deg2rad(25.0)  # limit of a face's angle from the vertical: a large bias tilts the measurement
TURN_RAD = np.deg2rad(20.0)  # limit of a complete turn's deviation from 360 deg
LONGEST_MOVE_S = 20.0
FEWEST_POSES, WORST_CONDITION = 9, 1e4
STEPS = 30
SHORTEST_S, TRIM_S, MOST_TRIMMED = 1.0, 0.5, 0.25


class Unfit(Exception):  # noqa: N818 - reads as the sentence it is
    """Recording that lacks what a method needs, as the message says."""


@dataclass(frozen=True)
class Estimate:
    """y = D s + b_a and w = K (y - b_omega), in m/s^2 and rad/s; `note` is a remark."""

    D: Vector
    b_a: Vector
    K: Vector
    b_omega: Vector
    note: str = ""


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

    def trimmed(self) -> Rests:
        """Return the rests without half a second at each end, or a quarter of a short one, while a board settles."""
        a, b = self.runs.T
        cut = np.minimum(round(TRIM_S * self.recording.rate_hz), (MOST_TRIMMED * (b - a)).astype(np.intp))
        return replace(self, runs=np.stack([a + cut, b - cut], axis=1))

    def moves(self, K: Vector) -> list[tuple[int, Vector]]:
        """Return (k, F) of each short move: F (3, 3) carries a vector of the body at rest k to that at k + 1."""
        r = self.recording
        moves = []
        for k, ((_, a), (b, _)) in enumerate(pairwise(self.runs.tolist())):
            if r.t[b] - r.t[a - 1] <= LONGEST_MOVE_S:
                rate = (r.gyr[a - 1 : b] - self.b_omega[k : k + 2].mean(0)) @ K.T
                moves.append((k, turned(-np.diff(r.t[a - 1 : b + 1])[:, None] * rate)))
        return moves

    def misses_rad(self, D: Vector, b_a: Vector, K: Vector) -> Vector:
        """Return angles between calibrated gravity at each rest and what the gyroscope carried there."""
        s = (self.y - b_a) @ np.linalg.inv(D).T
        u = s / np.linalg.norm(s, axis=1, keepdims=True)
        return np.arccos([np.clip(F @ u[k] @ u[k + 1], -1.0, 1.0) for k, F in self.moves(K)])


def six_positions(rests: Rests, gravity: float) -> Estimate:
    """Estimate scale factors and biases, each axis by itself, from six faces, as most instructions for hobbyists do."""
    up, down = (np.diag([rests.y[k] for k in faces(rests)[i::2]]) for i in (0, 1))
    return Estimate(np.diag((up - down) / (2.0 * gravity)), (up + down) / 2.0, np.eye(3), rests.flat.b_omega)


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
        # in units of g, T's columns and b's are alike
        J = np.hstack([unit[:, upper[0]] * y[:, upper[1]] / gravity, -unit @ T])
        condition = float(np.linalg.cond(J))
        if not condition < WORST_CONDITION:
            raise Unfit("the rests' orientations leave the ellipsoid open")
        step = np.linalg.lstsq(J, gravity - length, rcond=None)[0]
        T[upper] += step[:6] / gravity
        b = b + step[6:]
    if not (np.isfinite(T).all() and np.abs(step).max() < 1e-6 and np.linalg.det(T) > 0):
        raise Unfit(f"does not converge (condition {condition:.0f})")
    return Estimate(np.linalg.inv(T), b, np.eye(3), rests.flat.b_omega, f"condition {condition:.0f}")


def aligned_ellipsoid(rests: Rests, gravity: float) -> Estimate:
    """Find the ellipsoid, turned by the Q that makes the gyroscope carry gravity best from rest to rest."""
    free = ellipsoid(rests, gravity)
    moves = rests.moves(np.eye(3))
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
    return Estimate(free.D @ Q.T, free.b_a, free.K, free.b_omega, free.note)


def imucal(rests: Rests, gravity: float) -> Estimate:
    """Calibrate by Ferraris et al. (1995) as mad-lab-fau/imucal does: six faces, and a turn about each axis."""
    try:
        from imucal import FerrarisCalibration, FerrarisSignalRegions  # noqa: PLC0415 - optional
    except ImportError as error:
        raise Unfit("not installed (pip install imucal)") from error
    r = rests.recording
    spans = dict(zip(("x_p", "x_a", "y_p", "y_a", "z_p", "z_a"), rests.runs[faces(rests)].tolist(), strict=True))
    turns, angle = complete_turns(rests)
    spans |= dict(zip(("x_rot", "y_rot", "z_rot"), turns, strict=True))
    sections = {f"acc_{name}": r.acc[a:b] for name, (a, b) in spans.items()}
    sections |= {f"gyr_{name}": np.degrees(r.gyr[a:b]) for name, (a, b) in spans.items()}
    found = FerrarisCalibration(grav=gravity, expected_angle=angle).compute(
        FerrarisSignalRegions(**sections), r.rate_hz, from_acc_unit="m/s^2", from_gyr_unit="deg/s"
    )
    K = np.linalg.inv(found.R_g) @ np.linalg.inv(found.K_g)
    return Estimate(found.K_a @ found.R_a, found.b_a, K, np.radians(found.b_g))


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


def complete_turns(rests: Rests) -> tuple[list[tuple[int, int]], float]:
    """Return (first, last + 1) of a complete turn about x, y and z each, and their common angle, ±360 deg."""
    r = rests.recording
    spans: dict[int, tuple[int, int]] = {}
    angles = np.zeros(3)
    for (_, a), (b, _) in pairwise(rests.runs.tolist()):
        turned = ((r.gyr[a:b] - rests.flat.b_omega) * np.diff(r.t[a - 1 : b])[:, None]).sum(0)
        axis = int(np.argmax(np.abs(turned)))
        if np.all(np.abs(np.abs(turned) - 2.0 * np.pi * np.eye(3)[axis]) < TURN_RAD):
            spans[axis], angles[axis] = (a, b), turned[axis]
    missing = [name for axis, name in enumerate("xyz") if axis not in spans]
    if missing:
        raise Unfit(f"no complete turn about {', '.join(missing)}")
    if abs(np.sign(angles).sum()) != 3.0:
        raise Unfit("the complete turns go both ways")
    return [spans[axis] for axis in range(3)], 360.0 * float(np.sign(angles[0]))
