"""The uncertainty of a calibrated measurement over all directions of gravity, by the covariance of D and b_a."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Vector
from .sphere import fibonacci_sphere

DIRECTIONS = 400


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of a calibrated measurement, over all directions of gravity.

    Attributes
    ----------
    rms_mps2 : of the vector. magnitude_mps2, direction_rad : of its length and angle.
    worst_mps2 : of the least known direction, `worst` (3,) unit, in the body frame.
    """

    rms_mps2: float
    magnitude_mps2: float
    direction_rad: float
    worst_mps2: float
    worst: Vector


def uncertainty(D: Vector, covariance: Vector, gravity: float, unit: Vector | None = None) -> Uncertainty:
    """What the (12, 12) covariance of (D row-major, b_a) means for inv(D) (y - b_a) with |s| = gravity.

    unit : (n, 3) directions of s; None: all over the sphere.
    """
    unit = fibonacci_sphere(DIRECTIONS) if unit is None else unit
    s = gravity * unit
    # the error is -inv(D) (dD s + db): linear in the twelve parameters
    J = np.zeros((len(unit), 3, 12))
    for i in range(3):
        J[:, i, 3 * i : 3 * i + 3] = s
        J[:, i, 9 + i] = 1.0
    J = np.linalg.inv(D) @ J
    C = J @ covariance @ np.swapaxes(J, 1, 2)
    total = np.maximum(np.trace(C, axis1=1, axis2=2), 0.0)
    along = np.maximum(np.einsum("ni,nij,nj->n", unit, C, unit), 0.0)
    worst = int(np.argmax(total))
    return Uncertainty(
        rms_mps2=float(np.sqrt(total.mean())),
        magnitude_mps2=float(np.sqrt(along.mean())),
        direction_rad=float(np.sqrt(np.maximum(total - along, 0.0).mean()) / gravity),
        worst_mps2=float(np.sqrt(total[worst])),
        worst=unit[worst],
    )
