"""Disturbance by a hand: tremor, sway, jerks, and the lever between the sensor and the pivot of its rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Vector
from .rotation import cross_rows

SWAY_HZ, TREMOR_HZ = (0.5, 4.0), (2.0, 10.0)
# Peak and duration of a jerk, half a sine
JERK_MPS2, JERK_S = (2.0, 6.0), (0.06, 0.12)


@dataclass(frozen=True)
class HandDisturbance:
    """Amplitudes of a hand's disturbance.

    Attributes
    ----------
    lever_m : least and greatest distance of the sensor from the pivot.
    sway_mps2 : rms of each axis' acceleration while it moves, within SWAY_HZ. jerks_per_s : also while it moves.
    tremor_mps2, tremor_rad_s : rms of each axis while it holds a pose, within TREMOR_HZ; the acceleration includes
        that of the lever.
    wobble : rms of the pivot's travel relative to the distance, of whole recordings.
    """

    lever_m: tuple[float, float] = (0.15, 0.3)
    sway_mps2: float = 0.3
    jerks_per_s: float = 0.3
    tremor_mps2: float = 0.0
    tremor_rad_s: float = 0.0
    wobble: float = 0.0


# The rate is 1 deg/s over all axes.
TYPICAL_TREMOR = HandDisturbance(tremor_mps2=0.1, tremor_rad_s=float(np.radians(1.0) / np.sqrt(3)))


def point_acceleration(alpha: Vector, omega: Vector, r: Vector, v: Vector | float = 0.0) -> Vector:
    """Return the acceleration (n, 3) [m/s^2] in the body of a point r [m] that moves by v [m/s] on a rotating board.

    alpha x r + omega x (omega x r + 2 v), with omega, alpha (n, 3) [rad/s, rad/s^2].
    """
    return np.asarray(cross_rows(alpha, r) + cross_rows(omega, cross_rows(omega, r) + 2.0 * v))
