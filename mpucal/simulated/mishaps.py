"""What befalls a sensor in a careless hand: a slip, a knock, a step of its bias, warmth."""

from __future__ import annotations

import math

import numpy as np

from ..data import Vector
from ..result.error_model import MG_PER_MPS2
from .legs import minimum_jerk

SLIP_RAD = np.radians([5.0, -4.0, 5.0])
SLIP_S = 0.3
KNOCK_MPS2, KNOCK_S = 120.0, 0.02
# A shock may leave a sensor's zero elsewhere.
ZERO_SHIFT_MPS2 = np.array([0.25, -0.3, 0.2])
ZERO_STEP_MPS2 = np.array([10.0 / MG_PER_MPS2, 0.0, 0.0])
WARMER_C, WARMING_S = 15.0, 40.0
# PS-MPU-6000A r3.4, sections 6.1 and 6.2, in round numbers.
ACC_MPS2_A_C, GYRO_RAD_S_A_C = 0.005, math.radians(0.1)


class Mishap:
    """Nothing happens; a kind overrides what it does from `begin` on."""

    def __init__(self) -> None:
        self._begun_s = math.inf

    def begin(self, t_s: float) -> None:
        """It happens at `t_s`, once."""
        self._begun_s = min(self._begun_s, t_s)

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """What the sensor feels of specific force (n, 3) [m/s^2] and rate (n, 3) [rad/s] at times (n,)."""
        return force, rate

    def warmer_c(self, t_s: Vector) -> Vector:
        """(n,) by how much the chip is warmer than at first."""
        return np.zeros(len(t_s))

    def _share(self, t_s: Vector, seconds: float) -> Vector:
        """(n,) 0 before, 1 after."""
        return minimum_jerk((t_s - self._begun_s) / seconds) if math.isfinite(self._begun_s) else np.zeros(len(t_s))


class Slip(Mishap):
    """The accelerometer's mount gives way, and the gyroscope's does not."""

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """Turned by some degrees, slowly enough for nobody to notice."""
        turn = self._share(t_s, SLIP_S)[:, None] * SLIP_RAD
        # small enough for one step of a turn
        return force - np.cross(turn, force), rate


class Knock(Mishap):
    """A blow, after which the accelerometer's zero is elsewhere."""

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """The blow and what it left."""
        share = self._share(t_s, KNOCK_S)[:, None]
        return force + share * ZERO_SHIFT_MPS2 + 4.0 * share * (1.0 - share) * KNOCK_MPS2, rate


class ZeroStep(Mishap):
    """The accelerometer's bias steps, and nobody notices.

    Parameters
    ----------
    step : (3,) m/s^2.
    """

    def __init__(self, step: Vector = ZERO_STEP_MPS2) -> None:
        super().__init__()
        self._step = step

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """From one sample to the next."""
        return force + (t_s >= self._begun_s)[:, None] * self._step, rate


class Warmth(Mishap):
    """The sun comes out: the chip warms, and its biases follow."""

    def apply(self, force: Vector, rate: Vector, t_s: Vector) -> tuple[Vector, Vector]:
        """As by the data sheet."""
        warmer = self.warmer_c(t_s)[:, None]
        return force + ACC_MPS2_A_C * warmer, rate + GYRO_RAD_S_A_C * warmer

    def warmer_c(self, t_s: Vector) -> Vector:
        """Up to 15 C."""
        return WARMER_C * self._share(t_s, WARMING_S)
