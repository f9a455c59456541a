"""Sensors drawn for a study: those of the paper's section 4.3, and an MPU-6050 as they are sold."""

from __future__ import annotations

import numpy as np

from mpucal.chip.families import MPU6050
from mpucal.data import STANDARD_GRAVITY_MPS2
from mpucal.simulated.sensor import SensorTruth, density, non_orthogonality, turned

GRAVITY_MPS2 = 9.82


def paper_sensor(rng: np.random.Generator, rate_hz: float = 100.0) -> SensorTruth:
    """A sensor of the paper's section 4.3: a gyroscope that is ideal but for its bias, an accelerometer far off.

    The paper draws the noise of a sample, which is then the same at any `rate_hz`.
    """
    gain = rng.uniform(0.5, 1.5, 3)
    skew, misalignment = np.radians(rng.uniform(-30, 30, 3)), np.radians(rng.uniform(-10, 10, 3))
    return SensorTruth(
        D=np.diag(gain) @ non_orthogonality(*skew) @ turned(-misalignment),
        b_a=rng.uniform(-1, 1, 3),
        K=np.eye(3),
        b_omega=rng.uniform(-1, 1, 3),
        gravity=GRAVITY_MPS2,
        accel_noise_density=density(np.sqrt(rng.uniform(1e-3, 1e-1, 3)), rate_hz),
        gyro_noise_density=density(np.sqrt(rng.uniform(1e-3, 1e-2, 3)), rate_hz),
    )


def hand_sensor(rng: np.random.Generator, perfect_gyro: bool = False) -> SensorTruth:
    """An MPU-6050 as they are sold."""
    gain = rng.uniform(0.97, 1.03, 3)
    skew, misalignment = rng.uniform(-0.02, 0.02, 3), np.radians(rng.uniform(-2, 2, 3))
    b_a, b_omega = rng.uniform(-0.08, 0.08, 3) * STANDARD_GRAVITY_MPS2, np.radians(rng.uniform(-20, 20, 3))
    error = np.where(np.eye(3, dtype=bool), rng.uniform(-0.03, 0.03, (3, 3)), rng.uniform(-0.02, 0.02, (3, 3)))
    return SensorTruth(
        D=np.diag(gain) @ non_orthogonality(*skew) @ turned(-misalignment),
        b_a=b_a,
        K=np.eye(3) if perfect_gyro else np.asarray(np.linalg.inv(np.eye(3) + error)),
        b_omega=b_omega,
        gravity=GRAVITY_MPS2,
        accel_noise_density=MPU6050.accel_noise_ug * 1e-6 * STANDARD_GRAVITY_MPS2,
        gyro_noise_density=float(np.radians(MPU6050.gyro_noise_dps)),
    )
