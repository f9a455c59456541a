"""A calibration of a stream, and the parameters behind the stream, made into new parameters. Knows no name and no link.

An autopilot delivers y = R_b K (s - o) of what its sensor measures, s: offset o and scale K = diag(k) in the sensor's
axes, then the board's rotation R_b. The calibration says y = D f + b of the specific force f, so that with

    o' = o + inv(K) R_b^T b,    M = R_b^T inv(D) R_b K

R_b M (s - o') is f itself. An autopilot holds M's diagonal only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector


@dataclass(frozen=True)
class Correction:
    """What an IMU's parameters do to what its sensor measures: (s - offset) * scale.

    Attributes
    ----------
    offset : (3,) m/s^2, and scale : (3,), in the sensor's axes.
    """

    offset: Vector
    scale: Vector

    def seen_through(self, new: Correction, R_b: Vector, y: Vector) -> Vector:
        """What (..., 3) m/s^2 of the stream become once `new` is in this one's place."""
        s = y @ R_b / self.scale + self.offset
        return np.asarray(((s - new.offset) * new.scale) @ R_b.T)


@dataclass(frozen=True)
class Composed:
    """What the parameters become, and what they cannot hold.

    Attributes
    ----------
    correction : the new parameters. M : (3, 3), of which they hold the diagonal.
    residual_mps2 : by how much |a| is still wrong at worst, whatever the attitude.
    turn_rad : (3,) in the vehicle's axes, small: how the whole calibrated sensor is turned against the gyroscope,
        which level calibration removes and parameters do not.
    """

    correction: Correction
    M: Vector
    residual_mps2: float
    turn_rad: Vector


def compose(D: Vector, b_a: Vector, old: Correction, R_b: Vector, gravity: float) -> Composed:
    """The parameters that bring the stream nearest to f.

    Parameters
    ----------
    D : (3, 3), b_a : (3,) m/s^2 of the stream as received while `old` was in place.
    R_b : (3, 3) from the sensor's axes to the vehicle's. gravity : m/s^2 that D was fitted with: autopilots calibrate
        to 9.80665 wherever they are.
    """
    offset = old.offset + R_b.T @ b_a / old.scale
    M = R_b.T @ np.linalg.inv(D) @ R_b @ np.diag(old.scale) * (STANDARD_GRAVITY_MPS2 / gravity)
    correction = Correction(offset, np.diag(M).copy())
    return Composed(correction, M, residual_mps2(M, correction.scale), _turn(M, correction.scale, R_b))


def residual_mps2(M: Vector, scale: Vector) -> float:
    """By how much |a| is wrong at worst, in m/s^2, where `scale` (3,) stands for M (3, 3), to first order.

    a = diag(scale) inv(M) f, so |a| - g = g u^T S u with S the symmetric part of diag(scale) inv(M) - I.
    """
    left = np.diag(scale) @ np.linalg.inv(M) - np.eye(3)
    return float(STANDARD_GRAVITY_MPS2 * np.abs(np.linalg.eigvalsh((left + left.T) / 2)).max())


def _turn(M: Vector, scale: Vector, R_b: Vector) -> Vector:
    """The rotation vector (3,) of the antisymmetric part, to first order."""
    left = np.diag(scale) @ np.linalg.inv(M) - np.eye(3)
    skew = (left - left.T) / 2
    return np.asarray(R_b @ np.array([skew[2, 1], skew[0, 2], skew[1, 0]]))
