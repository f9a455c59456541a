"""What a calibration's numbers may be off by, beforehand: its own uncertainty, ageing, and each thing that can happen.

All are standard deviations of independent parts of theta (see `observed`), as covariances (21, 21). Sources: zero-g
level, sensitivity and zero-rate output over temperature and at 25 degrees Celsius of PS-MPU-6000A r3.4 and PS-MPU-6500A
r1.0, section 3.1 and 3.2. No data sheet of these chips states ageing. Its figures here are what one phone's sensor did
from session to session, 1.3 to 2.2 mg with its temperature unknown, and what the simulated sensors of this program do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..result.calibration import Calibration
from ..result.correlation import standard_deviations
from .observed import BETA, DELTA, PARAMETERS, UPPER, E, G

MG = 1e-3 * STANDARD_GRAVITY_MPS2
DEG = math.pi / 180.0


@dataclass(frozen=True)
class Spread:
    """Standard deviations of what may differ.

    bias : m/s^2. scale, skew : of E, on and off the diagonal, symmetric. turn : rad, of the accelerometer's mount.
    gyro_bias : rad/s. gyro_scale, gyro_skew : of G.
    """

    bias: float = 0.0
    scale: float = 0.0
    skew: float = 0.0
    turn: float = 0.0
    gyro_bias: float = 0.0
    gyro_scale: float = 0.0
    gyro_skew: float = 0.0

    def covariance(self) -> Vector:
        """(21, 21) of theta."""
        P = np.zeros((PARAMETERS, PARAMETERS))
        P[:9, :9] = np.diag(np.eye(3).ravel()) * self.scale**2
        for i, j in ((0, 1), (0, 2), (1, 2)):
            for sign, std in ((1.0, self.skew), (-1.0, self.turn)):
                both = np.zeros(9)
                both[3 * i + j], both[3 * j + i] = 1.0, sign
                P[E, E] += std**2 * np.outer(both, both)
        P[BETA, BETA] = np.eye(3) * self.bias**2
        P[G, G] = np.diag(np.where(UPPER[0] == UPPER[1], self.gyro_scale, self.gyro_skew) ** 2)
        P[DELTA, DELTA] = np.eye(3) * self.gyro_bias**2
        return P


# what switching off and on again, and the first hours, change
REPEATED = Spread(0.7 * MG, 3e-4, 2e-4, 0.02 * DEG, 0.3 * DEG, 5e-4, 3e-4)
# of the bias, m/s^2 a root of a day, and its end
WALK_MPS2, WALK_MOST_MPS2 = 0.1 * MG, 2.0 * MG
# where a temperature is not known, it may have been so many degrees away
UNKNOWN_C = 3.0
# a thermometer, and a chip that warms unevenly
LEAST_C = 2.0
# a degree Celsius, of the kind of chip
BY_TEMPERATURE: Mapping[str, Spread] = MappingProxyType(
    {
        "MPU-6050": Spread(0.5 * MG, 2e-4, gyro_bias=0.16 * DEG, gyro_scale=2e-4),
        "MPU-6500": Spread(1.0 * MG, 2.6e-4, gyro_bias=0.24 * DEG, gyro_scale=4e-4),
    }
)
# of what a fit does not say the uncertainty of
TOLERANCE = Spread(80.0 * MG, 0.03, 0.02, 2.0 * DEG, 20.0 * DEG, 0.02, 0.01)
# of a gyroscope's matrix that a fit has found to be no different from the identity
PERFECT_GYRO = 0.003

# what can happen to a sensor besides: how much it then changes, and how often of all that happens
HAPPENINGS: Mapping[str, tuple[float, Spread]] = MappingProxyType(
    {
        "bias": (0.4, Spread(bias=20.0 * MG)),
        "scale": (0.1, Spread(scale=0.01)),
        "mount": (0.15, Spread(turn=2.0 * DEG)),
        "gyroscope's bias": (0.1, Spread(gyro_bias=5.0 * DEG)),
        "gyroscope's scale": (0.05, Spread(gyro_scale=0.02, gyro_skew=0.01)),
        "another sensor": (0.2, Spread(100.0 * MG, 0.02, 0.01, 1.5 * DEG, 10.0 * DEG, 0.015, 0.012)),
    }
)
TEMPERATURE, OFTEN_BY_TEMPERATURE = "temperature", 0.5


def own_uncertainty(calibration: Calibration) -> Vector:
    """(21, 21) of theta, from the standard deviations that a calibration states, and their correlation."""
    spread = np.sqrt(np.diag(TOLERANCE.covariance()))
    # it has no spread of D, row-major, but of its symmetric and antisymmetric parts
    spread[E] = np.where(np.eye(3, dtype=bool), TOLERANCE.scale, TOLERANCE.skew).ravel()
    if calibration.fit.get("model") in ("accel", "paper"):
        spread[G] = PERFECT_GYRO
    std = standard_deviations(vars(calibration))
    known = np.isfinite(std)
    rho = np.where(np.outer(known, known), calibration.correlation, np.eye(PARAMETERS))
    # rounded, or of unknown origin: without what no errors have
    values, vectors = np.linalg.eigh(rho)
    root = to_theta(calibration) @ (np.where(known, std, spread)[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
    return np.asarray(root @ root.T)


def to_theta(calibration: Calibration) -> Vector:
    """(21, 21) by which small errors of D, b_a, K and b_omega, as in `mpucal.result.correlation`, make theta."""
    A, M = calibration.inverse, np.eye(PARAMETERS)
    M[E, E], M[BETA, BETA] = np.kron(A, np.eye(3)), A
    return M


def ageing(calibration: Calibration, days: float, change_c: float | None) -> Vector:
    """(21, 21) of theta: what an unchanged sensor shows after `days`, at a temperature that has not moved.

    Where the change of temperature is not known, a few degrees are in it; where b_a(T) is known, its uncertainty.
    """
    P = REPEATED.covariance()
    P[BETA, BETA] += np.eye(3) * min(WALK_MPS2**2 * max(days, 0.0), WALK_MOST_MPS2**2)
    if change_c is None:
        return P + by_temperature(calibration, UNKNOWN_C)
    if calibration.follows_temperature:
        A = calibration.inverse
        slope = np.nan_to_num(calibration.b_a_slope_std) * change_c
        P[BETA, BETA] += A @ np.diag(slope**2) @ A.T
    return P


def by_temperature(calibration: Calibration, change_c: float) -> Vector:
    """(21, 21) of theta: what a data sheet lets a change of temperature do."""
    kind = "MPU-6050" if "6050" in (calibration.sensor.chip or "6050") else "MPU-6500"
    return BY_TEMPERATURE[kind].covariance() * change_c**2


def happenings(calibration: Calibration, change_c: float | None) -> dict[str, tuple[float, Vector]]:
    """What can happen: of each, how often, and the covariance (21, 21) that it adds; a change of temperature, too."""
    all_ = {name: (often, spread.covariance()) for name, (often, spread) in HAPPENINGS.items()}
    if change_c is not None and abs(change_c) >= LEAST_C:
        all_[TEMPERATURE] = OFTEN_BY_TEMPERATURE, by_temperature(calibration, change_c)
    return all_
