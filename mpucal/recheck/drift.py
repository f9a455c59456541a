"""Prior covariances of a calibration's errors theta: its own uncertainty, ageing, and each hypothesis of a change.

All are covariances (23, 23) of theta (see `observed`), from standard deviations of independent parts. Sources: zero-g
level, sensitivity and zero-rate output over temperature and at 25 degrees Celsius of PS-MPU-6000A r3.4 and PS-MPU-6500A
r1.0, section 3.1 and 3.2. No data sheet of these chips states ageing. Its figures here were measured on one phone's
sensor from session to session, 1.3 to 2.2 mg with its temperature unknown, and on this program's simulated sensors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..data import Vector
from ..result.calibration import Calibration
from ..result.comparison import BIAS_MG_PER_C, TOLD_APART_C, like_chip
from ..result.correlation import UPPER, standard_deviations
from ..result.error_model import MG_PER_MPS2
from .observed import BETA, CALIBRATED, DELTA, NOISE, PARAMETERS, E, G


@dataclass(frozen=True)
class Spread:
    """Standard deviations of the parts of theta.

    bias : m/s^2. scale, skew : of E, on and off the diagonal, symmetric. turn : rad, of the accelerometer's mount.
    gyro_bias : rad/s. gyro_scale, gyro_skew : of G. noise : of the logarithms of noise.
    """

    bias: float = 0.0
    scale: float = 0.0
    skew: float = 0.0
    turn: float = 0.0
    gyro_bias: float = 0.0
    gyro_scale: float = 0.0
    gyro_skew: float = 0.0
    noise: float = 0.0

    def covariance(self) -> Vector:
        """Return the covariance (23, 23) of theta."""
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
        P[NOISE, NOISE] = np.eye(2) * self.noise**2
        return P


# Repeatability over a power cycle and the first hours.
REPEATED = Spread(0.7 / MG_PER_MPS2, 3e-4, 2e-4, math.radians(0.02), math.radians(0.3), 5e-4, 3e-4, noise=0.15)
# Random walk of the bias: m/s^2 in the root of a day, and its limit.
WALK_MPS2, WALK_MOST_MPS2 = 0.1 / MG_PER_MPS2, 2.0 / MG_PER_MPS2
# Standard deviation of a change of temperature that is not known.
UNKNOWN_C = 3.0
# Change in one degree Celsius, besides the bias, by kind of chip.
BY_TEMPERATURE: Mapping[str, Spread] = {
    "MPU-6050": Spread(scale=2e-4, gyro_bias=math.radians(0.16), gyro_scale=2e-4),
    "MPU-6500": Spread(scale=2.6e-4, gyro_bias=math.radians(0.24), gyro_scale=4e-4),
}
# Factory tolerances, for parameters whose uncertainty the calibration does not state.
TOLERANCE = Spread(80.0 / MG_PER_MPS2, 0.03, 0.02, math.radians(2.0), math.radians(20.0), 0.02, 0.01)
# Standard deviation of G where the fit found no difference from the identity.
PERFECT_GYRO = 0.003

# Hypotheses of a change: the prior probability of each, given that something changed, and the size of the change.
HYPOTHESES: Mapping[str, tuple[float, Spread]] = {
    "bias": (0.4, Spread(bias=20.0 / MG_PER_MPS2)),
    "scale": (0.1, Spread(scale=0.01)),
    "mount": (0.15, Spread(turn=math.radians(2.0))),
    "gyroscope's bias": (0.1, Spread(gyro_bias=math.radians(5.0))),
    "gyroscope's scale": (0.05, Spread(gyro_scale=0.02, gyro_skew=0.01)),
    "another sensor": (
        0.2,
        Spread(100.0 / MG_PER_MPS2, 0.02, 0.01, math.radians(1.5), math.radians(10.0), 0.015, 0.012),
    ),
    "noise": (0.1, Spread(noise=1.0)),
}
TEMPERATURE = "temperature"
TEMPERATURE_PRIOR = 0.5


def own_uncertainty(calibration: Calibration) -> Vector:
    """Return the covariance of theta that a calibration states by its standard deviations and correlation."""
    spread = np.sqrt(np.diag(TOLERANCE.covariance()))
    # TOLERANCE is of the symmetric and antisymmetric parts of E; here its elements are needed.
    spread[E] = np.where(np.eye(3, dtype=bool), TOLERANCE.scale, TOLERANCE.skew).ravel()
    if calibration.fit.get("model") in ("accel", "paper"):
        spread[G] = PERFECT_GYRO
    std, correlation = np.full(PARAMETERS, np.nan), np.eye(PARAMETERS)
    std[:CALIBRATED] = standard_deviations(vars(calibration))
    correlation[:CALIBRATED, :CALIBRATED] = calibration.correlation
    known = np.isfinite(std)
    rho = np.where(np.outer(known, known), correlation, np.eye(PARAMETERS))
    # Rounded correlations may have negative eigenvalues, which no covariance has.
    values, vectors = np.linalg.eigh(rho)
    root = to_theta(calibration) @ (np.where(known, std, spread)[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
    # Without a gyroscope the rotation of the mount was not estimated.
    mount = Spread(turn=TOLERANCE.turn if calibration.fit.get("model") == "static" else 0.0)
    return np.asarray(root @ root.T) + mount.covariance()


def to_theta(calibration: Calibration) -> Vector:
    """Return the matrix (23, 23) from errors of D, b_a, K, b_omega, as in `mpucal.result.correlation`, to theta."""
    A, M = calibration.inverse, np.eye(PARAMETERS)
    M[E, E], M[BETA, BETA] = np.kron(A, np.eye(3)), A
    return M


def ageing(calibration: Calibration, days: float, change_c: float | None) -> Vector:
    """Return the covariance of theta of an unchanged sensor after `days`, at an unchanged temperature.

    It includes a few degrees where the change of temperature is not known, and b_a(T)'s uncertainty where that is.
    """
    P = REPEATED.covariance()
    P[BETA, BETA] += np.eye(3) * min(WALK_MPS2**2 * max(days, 0.0), WALK_MOST_MPS2**2)
    if change_c is None:
        return P + temperature_covariance(calibration, UNKNOWN_C)
    if calibration.follows_temperature:
        A = calibration.inverse
        slope = np.nan_to_num(calibration.b_a_slope_std) * change_c
        P[BETA, BETA] += A @ np.diag(slope**2) @ A.T
    return P


def temperature_covariance(calibration: Calibration, change_c: float) -> Vector:
    """Return the covariance of theta by a change of temperature, from the data sheet."""
    like = like_chip(calibration.sensor.chip)
    return replace(BY_TEMPERATURE[like], bias=BIAS_MG_PER_C[like] / MG_PER_MPS2).covariance() * change_c**2


def hypotheses(calibration: Calibration, change_c: float | None) -> dict[str, tuple[float, Vector]]:
    """Return the prior probability of each hypothesis and the covariance (23, 23) that it adds to theta."""
    all_ = {name: (prior, spread.covariance()) for name, (prior, spread) in HYPOTHESES.items()}
    if change_c is not None and abs(change_c) >= TOLD_APART_C:
        all_[TEMPERATURE] = TEMPERATURE_PRIOR, temperature_covariance(calibration, change_c)
    return all_
