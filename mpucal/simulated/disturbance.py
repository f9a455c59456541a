"""Disturbances: by a hand that trembles, sways and jerks, and by mishaps of the sensor in it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..calibration.rotation import cross_rows
from ..data import Vector
from ..result.error_model import MG_PER_MPS2
from .legs import minimum_jerk

SWAY_HZ, TREMOR_HZ = (0.5, 4.0), (2.0, 10.0)
# Sway and physiological tremor of an arm that holds a pose
HELD_HZ, ARM_HZ = (0.05, 1.0), (8.0, 12.0)
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
        # it trembles about the wrist, 0.1 m away
        tremor_mps2=0.1 * pulsation * rate,
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


# A change of a sensor: from the seconds since its begin (n,), negative before it, and from specific force [m/s^2] and
# rate [rad/s] without it, both (n, 3), to those that it feels.
Change = Callable[[Vector, Vector, Vector], tuple[Vector, Vector]]


def slip(since_s: Vector, force: Vector, rate: Vector) -> tuple[Vector, Vector]:
    """Turn the accelerometer by 8 deg on its mount, too slowly for the operator to notice; the gyroscope stays."""
    turn = _share(since_s, 0.3) * np.radians([5.0, -4.0, 5.0])
    # The angle is small: a first-order rotation is exact enough.
    return force - np.cross(turn, force), rate


def knock(since_s: Vector, force: Vector, rate: Vector) -> tuple[Vector, Vector]:
    """Add a blow of 20 ms and 120 m/s^2, which shifts the accelerometer's zero by 0.4 m/s^2."""
    share = _share(since_s, 0.02)
    return force + share * np.array([0.25, -0.3, 0.2]) + 4.0 * share * (1.0 - share) * 120.0, rate


def zero_step(
    since_s: Vector, force: Vector, rate: Vector, step_mps2: ArrayLike = (10.0 / MG_PER_MPS2, 0.0, 0.0)
) -> tuple[Vector, Vector]:
    """Step the accelerometer's bias from one sample to the next, which the operator does not notice."""
    return force + (since_s >= 0.0)[:, None] * np.asarray(step_mps2), rate


def warming(since_s: Vector, force: Vector, rate: Vector) -> tuple[Vector, Vector]:
    """Add biases by temperature, as in sunshine: 0.5 mg and 0.1 deg/s a degree, as in the data sheets' 6.1 and 6.2."""
    warmer = _warmer_c(since_s)
    return force + 0.005 * warmer, rate + math.radians(0.1) * warmer


def _warmer_c(since_s: Vector) -> Vector:
    """Return (n, 1) degrees Celsius by which it is warmer: 15 within 40 s."""
    return 15.0 * _share(since_s, 40.0)


def _share(since_s: Vector, seconds: float) -> Vector:
    """Return (n, 1) the progress of a change that takes `seconds`: 0 before, 1 after."""
    return minimum_jerk(since_s / seconds)[:, None]


@dataclass
class Mishap:
    """Change of a sensor, and the time of its begin; infinity: not yet."""

    change: Change
    begun_s: float = math.inf

    def begin(self, t_s: float) -> None:
        """Schedule it at `t_s`, unless it began before."""
        self.begun_s = min(self.begun_s, t_s)

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """Return specific force (n, 3) [m/s^2] and rate (n, 3) [rad/s] at the sensor, changed by it, at times (n,)."""
        return self.change(t_s - self.begun_s, force, rate)

    def warmer_c(self, t_s: Vector) -> Vector:
        """Return (n,) degrees Celsius by which the chip is warmer than at first."""
        return _warmer_c(t_s - self.begun_s)[:, 0] if self.change is warming else np.zeros(len(t_s))
