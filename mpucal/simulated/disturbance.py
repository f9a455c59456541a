"""Disturbance by a hand: tremor, sway, jerks, and the lever between the sensor and the pivot of its rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Vector
from .rotation import cross_rows

SWAY_HZ, TREMOR_HZ = (0.5, 4.0), (2.0, 10.0)
# Sway and physiological tremor of an arm that holds a pose, and the distance of the wrist, about which it trembles
HELD_HZ, ARM_HZ, WRIST_M = (0.05, 1.0), (8.0, 12.0), 0.1
# Peak and duration of a jerk, half a sine
JERK_MPS2, JERK_S = (2.0, 6.0), (0.06, 0.12)


@dataclass(frozen=True)
class HandDisturbance:
    """Amplitudes of a hand's disturbance.

    Attributes
    ----------
    lever_m : least and greatest distance of the sensor from the pivot.
    sway_mps2 : rms of each axis' acceleration while it moves, within SWAY_HZ. jerks_per_s : also while it moves.
    tremor_mps2, tremor_rad_s : rms of each axis while it holds a pose, within tremor_hz; the acceleration includes
        that of the lever.
    held_m, held_rad : rms of each axis' sway while it holds a pose, within HELD_HZ.
    wobble : rms of the pivot's travel relative to the distance, of whole recordings.
    """

    lever_m: tuple[float, float] = (0.15, 0.3)
    sway_mps2: float = 0.3
    jerks_per_s: float = 0.3
    tremor_mps2: float = 0.0
    tremor_rad_s: float = 0.0
    tremor_hz: tuple[float, float] = TREMOR_HZ
    held_m: float = 0.0
    held_rad: float = 0.0
    wobble: float = 0.0


def _arm(held_mm: float, held_mrad: float, tremor_mrad: float) -> HandDisturbance:
    pulsation = np.pi * sum(ARM_HZ)
    rate = 1e-3 * tremor_mrad * pulsation
    return HandDisturbance(
        tremor_mps2=WRIST_M * pulsation * rate,
        tremor_rad_s=rate,
        tremor_hz=ARM_HZ,
        held_m=1e-3 * held_mm,
        held_rad=1e-3 * held_mrad,
    )


# How the arm is held, by the literature on posture and tremor: people sway by 1 to 1.5 mm and 3 to 6 mrad below 1 Hz,
# and tremble by 0.25 to 0.8 mrad at 8 to 12 Hz; the less, the better the arm is supported.
# A steady hand trembles by 1 deg/s over all axes, and does not sway.
ARMS = {
    "steady": HandDisturbance(tremor_mps2=0.1, tremor_rad_s=float(np.radians(1.0) / np.sqrt(3))),
    "braced": _arm(0.3, 1.2, 0.3),
    "seated": _arm(0.6, 2.2, 0.4),
    "standing": _arm(1.0, 3.5, 0.5),
    "raised": _arm(1.3, 4.5, 0.65),
}
USUAL_ARM = "seated"


def point_acceleration(alpha: Vector, omega: Vector, r: Vector, v: Vector | float = 0.0) -> Vector:
    """Return the acceleration (n, 3) [m/s^2] in the body of a point r [m] that moves by v [m/s] on a rotating board.

    alpha x r + omega x (omega x r + 2 v), with omega, alpha (n, 3) [rad/s, rad/s^2].
    """
    return np.asarray(cross_rows(alpha, r) + cross_rows(omega, cross_rows(omega, r) + 2.0 * v))
