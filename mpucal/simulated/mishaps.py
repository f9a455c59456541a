"""Mishaps of a sensor in a careless hand: a slip, a knock, a step of its bias, warmth."""

from __future__ import annotations

import math

import numpy as np

from ..data import Vector
from ..result.error_model import MG_PER_MPS2
from .legs import minimum_jerk

SLIP_RAD = np.radians([5.0, -4.0, 5.0])
SLIP_S = 0.3
KNOCK_MPS2, KNOCK_S = 120.0, 0.02
# A shock may shift a sensor's zero.
ZERO_SHIFT_MPS2 = np.array([0.25, -0.3, 0.2])
ZERO_STEP_MPS2 = np.array([10.0 / MG_PER_MPS2, 0.0, 0.0])
WARMER_C, WARMING_S = 15.0, 40.0
# PS-MPU-6000A r3.4, sections 6.1 and 6.2, in round numbers.
ACC_MPS2_A_C, GYRO_RAD_S_A_C = 0.005, math.radians(0.1)


class Mishap:
    """Base of mishaps, which has no effect itself."""

    def __init__(self) -> None:
        self._begun_s = math.inf

    def begin(self, t_s: float) -> None:
        """Schedule it at `t_s`, unless it began before."""
        self._begun_s = min(self._begun_s, t_s)

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """Return specific force (n, 3) [m/s^2] and rate (n, 3) [rad/s] at the sensor, changed by it, at times (n,)."""
        return force, rate

    def warmer_c(self, t_s: Vector) -> Vector:
        """Return (n,) degrees Celsius by which the chip is warmer than at first."""
        return np.zeros(len(t_s))

    def _share(self, t_s: Vector, seconds: float) -> Vector:
        """Return (n,) the progress of a change that takes `seconds`: 0 before, 1 after."""
        return minimum_jerk((t_s - self._begun_s) / seconds) if math.isfinite(self._begun_s) else np.zeros(len(t_s))


class Slip(Mishap):
    """A slip of the accelerometer on its mount; the gyroscope stays."""

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """Turn the force by some degrees, too slowly for the operator to notice."""
        turn = self._share(t_s, SLIP_S)[:, None] * SLIP_RAD
        # The angle is small: a first-order rotation is exact enough.
        return force - np.cross(turn, force), rate


class Knock(Mishap):
    """A blow, which shifts the accelerometer's zero."""

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """Add the blow and the shift of the zero."""
        share = self._share(t_s, KNOCK_S)[:, None]
        return force + share * ZERO_SHIFT_MPS2 + 4.0 * share * (1.0 - share) * KNOCK_MPS2, rate


class ZeroStep(Mishap):
    """A step of the accelerometer's bias, which the operator does not notice.

    Parameters
    ----------
    step : (3,) m/s^2.
    """

    def __init__(self, step: Vector = ZERO_STEP_MPS2) -> None:
        super().__init__()
        self._step = step

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """Add the step from one sample to the next."""
        return force + (t_s >= self._begun_s)[:, None] * self._step, rate


class Warmth(Mishap):
    """Sunshine: the chip warms, and its biases follow."""

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """Add the biases of the data sheet's temperature coefficients."""
        warmer = self.warmer_c(t_s)[:, None]
        return force + ACC_MPS2_A_C * warmer, rate + GYRO_RAD_S_A_C * warmer

    def warmer_c(self, t_s: Vector) -> Vector:
        """Return up to WARMER_C."""
        return WARMER_C * self._share(t_s, WARMING_S)
