"""How far an estimate is from the truth, in numbers a person cares about."""

from __future__ import annotations

import numpy as np

from mpucal.calibration.ekf import Ekf, specific_force
from mpucal.calibration.flat_segment import Flat
from mpucal.data import Recording, Vector
from mpucal.simulated.sensor import SensorTruth


def sph_rms(truth: SensorTruth, D: Vector, b_a: Vector) -> float:
    """Root mean square, over all directions of gravity, of the error of a calibrated noise-free vector [m/s^2].

    The vector is inv(D) (D_true s + b_true - b_a) = s + A s + c, and the mean of |A s + c|^2 over the sphere |s| = g is
    g^2 / 3 |A|_F^2 + |c|^2.
    """
    A = np.linalg.solve(D, truth.D) - np.eye(3)
    c = np.linalg.solve(D, truth.b_a - b_a)
    return float(np.sqrt(truth.gravity**2 / 3.0 * np.sum(A * A) + c @ c))


def roll_pitch(s: Vector) -> tuple[Vector, Vector]:
    """Roll and pitch [rad] of specific forces (n, 3) in the body: both (n,)."""
    return np.arctan2(s[:, 1], s[:, 2]), np.arctan2(-s[:, 0], np.hypot(s[:, 1], s[:, 2]))


def tilt_errors_deg(s_true: Vector, s: Vector) -> tuple[float, float]:
    """Mean absolute errors of roll and pitch [deg] of estimated specific forces s (n, 3) against the true ones (n, 3).

    Roll is compared where the cosine of the true pitch is above 0.2: below, near ±90 deg, a small tilt turns it by any
    angle.
    """
    (roll_true, pitch_true), (roll, pitch) = roll_pitch(s_true), roll_pitch(s)
    seen = np.cos(pitch_true) > 0.2
    d_roll = np.abs(np.remainder(roll - roll_true + np.pi, 2.0 * np.pi) - np.pi)[seen]
    return float(np.degrees(d_roll.mean())), float(np.degrees(np.abs(pitch - pitch_true).mean()))


def followed(recording: Recording, flat: Flat, D: Vector, b_a: Vector, gravity: float) -> Vector:
    """Gravity (n, k, 3) [m/s^2] after the flat segment, as the paper's EKF finds it with D (k, 3, 3) and b_a (k, 3)."""
    x = np.concatenate([block.x for block in Ekf.after(flat, recording, gravity).run(D, b_a)])
    return specific_force(x, gravity)


def tilts_deg(s_true: Vector, s: Vector) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """k errors of roll and of pitch [deg], as `tilt_errors_deg`, of s (n, k, 3) where s_true is known."""
    known = np.isfinite(s_true).all(1)
    roll, pitch = zip(*(tilt_errors_deg(s_true[known], s[known, k]) for k in range(s.shape[1])), strict=True)
    return roll, pitch
