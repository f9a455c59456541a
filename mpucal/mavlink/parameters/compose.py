"""New parameters from a calibration of a stream and the parameters behind the stream.

An autopilot delivers y = R_b K (s - o) of its sensor's output s: offset o and scale K = diag(k) in the sensor's axes,
then the board's rotation R_b. The calibration says y = D f + b of the specific force f, so that with

    o' = o + inv(K) R_b^T b,    M = R_b^T inv(D) R_b K

R_b M (s - o') is f itself. An autopilot holds M's diagonal only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Vector


@dataclass(frozen=True)
class Correction:
    """The correction (s - offset) * scale that an IMU's parameters apply to the output s of its sensor.

    Attributes
    ----------
    offset : (3,) m/s^2, and scale : (3,), in the sensor's axes.
    """

    offset: Vector
    scale: Vector

    def recorrect(self, new: Correction, R_b: Vector, y: Vector) -> Vector:
        """Return the (..., 3) m/s^2 that a stream y under this correction would be under `new`."""
        s = y @ R_b / self.scale + self.offset
        return np.asarray(((s - new.offset) * new.scale) @ R_b.T)


@dataclass(frozen=True)
class Composed:
    """The correction that a calibration asks for, and what it cannot hold.

    Attributes
    ----------
    correction : the new parameters. M : (3, 3), of which they hold the diagonal.
    mounting : R_b (3, 3).
    """

    correction: Correction
    M: Vector
    mounting: Vector

    def residual_of(self, held: Correction) -> float:
        """Return the greatest error of |a| [m/s^2] over all attitudes if the vehicle holds `held`.

        a = R_b diag(scale) (inv(M) R_b^T f + o' - offset): |a| lies between the least and the largest singular value
        of diag(scale) inv(M), times g, and what the offsets differ by. (To first order that is g times the largest
        eigenvalue of the symmetric part of what is off the diagonal.)
        """
        singular = np.linalg.svd(self._deviation(held) + np.eye(3), compute_uv=False)
        shape = STANDARD_GRAVITY_MPS2 * np.abs(singular - 1).max()
        return float(shape + np.linalg.norm(held.scale * (self.correction.offset - held.offset)))

    def residual_rad_of(self, held: Correction) -> float:
        """Return the greatest error of the direction of a [rad] over all attitudes, beside `turn_rad`.

        To first order, the symmetric part S of diag(scale) inv(M) - I moves the unit vector u by S u, of which half the
        difference of S's extreme eigenvalues is the most that is at right angles to u.
        """
        left = self._deviation(held)
        values = np.linalg.eigvalsh((left + left.T) / 2)
        return float(values[-1] - values[0]) / 2

    @property
    def turn_rad(self) -> Vector:
        """Rotation (3,) of the sensor against the gyroscope, in the vehicle's axes, which parameters do not hold.

        Level calibration removes it (AHRS_TRIM). For small angles: the antisymmetric part of diag(scale) inv(M) - I.
        """
        left = self._deviation(self.correction)
        skew = (left - left.T) / 2
        return np.asarray(self.mounting @ np.array([skew[2, 1], skew[0, 2], skew[1, 0]]))

    def _deviation(self, held: Correction) -> Vector:
        """Return diag(scale) inv(M) - I."""
        return np.asarray(np.diag(held.scale) @ np.linalg.inv(self.M) - np.eye(3))


def compose(D: Vector, b_a: Vector, old: Correction, R_b: Vector, gravity: float) -> Composed:
    """Return the parameters that bring the stream nearest to f.

    Parameters
    ----------
    D : (3, 3), b_a : (3,) m/s^2 of the stream as received under `old`.
    R_b : (3, 3) from the sensor's axes to the vehicle's. gravity : m/s^2 that D was fitted with: autopilots calibrate
        to 9.80665 wherever they are.
    """
    offset = old.offset + R_b.T @ b_a / old.scale
    M = R_b.T @ np.linalg.inv(D) @ R_b @ np.diag(old.scale) * (STANDARD_GRAVITY_MPS2 / gravity)
    return Composed(Correction(offset, np.diag(M).copy()), M, R_b)
