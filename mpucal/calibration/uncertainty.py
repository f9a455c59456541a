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
    # the error is -inv(D) (dD s + db): linear in the twelve parameters, and in (s, 1)
    s = np.column_stack([gravity * unit, np.ones(len(unit))])
    J = np.zeros((4, 3, 12))
    for i in range(3):
        J[[0, 1, 2, 3], i, [3 * i, 3 * i + 1, 3 * i + 2, 9 + i]] = 1.0
    errors = (np.linalg.inv(D) @ J).reshape(12, 12)
    by_products = (errors @ covariance @ errors.T).reshape(4, 3, 4, 3).swapaxes(1, 2).reshape(16, 9)
    C = ((s[:, :, None] * s[:, None, :]).reshape(-1, 16) @ by_products).reshape(-1, 3, 3)
    total = np.maximum(np.einsum("nii->n", C), 0.0)
    along = np.maximum(np.einsum("ni,nij,nj->n", unit, C, unit), 0.0)
    worst = int(np.argmax(total))
    return Uncertainty(
        rms_mps2=float(np.sqrt(total.mean())),
        magnitude_mps2=float(np.sqrt(along.mean())),
        direction_rad=float(np.sqrt(np.maximum(total - along, 0.0).mean()) / gravity),
        worst_mps2=float(np.sqrt(total[worst])),
        worst=unit[worst],
    )
