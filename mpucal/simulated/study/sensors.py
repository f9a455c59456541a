"""Simulated sensors: how D, b_a, the gyroscope's errors and the noise come about. Knows no motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...data import Mask, Vector

STANDARD_G = 9.80665


@dataclass(frozen=True)
class SensorTruth:
    """A sensor: y = D s + b_a + noise and omega-bar = G omega + b_omega + noise.

    Attributes
    ----------
    D : (3, 3). b_a : (3,) m/s^2. G : (3, 3). b_omega : (3,) rad/s.
    sigma_a : (3,) m/s^2 and sigma_omega : (3,) rad/s, noise a sample.
    accel_step_mps2, gyro_step_rad_s : one count of a 16-bit output; 0 for an output as fine as float64.
    """

    D: Vector
    b_a: Vector
    G: Vector
    b_omega: Vector
    sigma_a: Vector
    sigma_omega: Vector
    accel_step_mps2: float = 0.0
    gyro_step_rad_s: float = 0.0

    def accelerometer(self, s: Vector, rng: np.random.Generator) -> tuple[Vector, Mask]:
        """What it reads (n, 3) [m/s^2] of the specific force s (n, 3), and which samples are clipped (n,)."""
        y = s @ self.D.T + self.b_a + self.sigma_a * rng.standard_normal(s.shape)
        return quantised(y, self.accel_step_mps2)

    def gyroscope(self, omega: Vector, rng: np.random.Generator) -> tuple[Vector, Mask]:
        """What it reads (n, 3) [rad/s] of the angular rate omega (n, 3), and which samples are clipped (n,)."""
        y = omega @ self.G.T + self.b_omega + self.sigma_omega * rng.standard_normal(omega.shape)
        return quantised(y, self.gyro_step_rad_s)

    def symmetric_frame(self) -> tuple[Vector, Vector]:
        """K and Q: in the body frame turned by Q the gyroscope's correction K = Q inv(G) is symmetric."""
        U, S, Vt = np.linalg.svd(np.linalg.inv(self.G))
        Q = Vt.T @ U.T
        return Vt.T @ np.diag(S) @ Vt, Q


def quantised(y: Vector, step: float) -> tuple[Vector, Mask]:
    """y (n, 3) as 16-bit counts of size step, and the samples (n,) with an axis at the end of its range."""
    if step == 0.0:
        return y, np.zeros(len(y), bool)
    counts = np.clip(np.rint(y / step), -32768, 32767)
    return counts * step, ((counts == -32768) | (counts == 32767)).any(axis=1)


def paper_sensor(rng: np.random.Generator) -> SensorTruth:
    """A sensor of the paper's section 4.3: a gyroscope that is ideal but for its bias, an accelerometer far off."""
    gain = rng.uniform(0.5, 1.5, 3)
    skew, misalignment = np.radians(rng.uniform(-30, 30, 3)), np.radians(rng.uniform(-10, 10, 3))
    return SensorTruth(
        D=np.diag(gain) @ non_orthogonality(*skew) @ misaligned(*misalignment),
        b_a=rng.uniform(-1, 1, 3),
        G=np.eye(3),
        b_omega=rng.uniform(-1, 1, 3),
        sigma_a=np.sqrt(rng.uniform(1e-3, 1e-1, 3)),
        sigma_omega=np.sqrt(rng.uniform(1e-3, 1e-2, 3)),
    )


def hand_sensor(rng: np.random.Generator, rate_hz: float, perfect_gyro: bool = False) -> SensorTruth:
    """An MPU-6050 as they are sold, at ±2 g and ±500 deg/s, its noise filtered to half the sample rate."""
    gain = rng.uniform(0.97, 1.03, 3)
    skew, misalignment = rng.uniform(-0.02, 0.02, 3), np.radians(rng.uniform(-2, 2, 3))
    b_a, b_omega = rng.uniform(-0.08, 0.08, 3) * STANDARD_G, np.radians(rng.uniform(-20, 20, 3))
    error = np.where(np.eye(3, dtype=bool), rng.uniform(-0.03, 0.03, (3, 3)), rng.uniform(-0.02, 0.02, (3, 3)))
    bandwidth = np.sqrt(rate_hz / 2.0)
    return SensorTruth(
        D=np.diag(gain) @ non_orthogonality(*skew) @ misaligned(*misalignment),
        b_a=b_a,
        G=np.eye(3) if perfect_gyro else np.eye(3) + error,
        b_omega=b_omega,
        sigma_a=np.full(3, 400e-6 * STANDARD_G * bandwidth),
        sigma_omega=np.full(3, np.radians(0.005) * bandwidth),
        accel_step_mps2=2.0 * STANDARD_G / 32768,
        gyro_step_rad_s=np.radians(500.0) / 32768,
    )


def non_orthogonality(zeta: float, eta: float, rho: float) -> Vector:
    """C_no of Kok and Schön (2014), section 4.3's skewed axes [rad]."""
    return np.array(
        [
            [1.0, 0.0, 0.0],
            [np.sin(zeta), np.cos(zeta), 0.0],
            [-np.sin(eta), np.cos(eta) * np.sin(rho), np.cos(eta) * np.cos(rho)],
        ]
    )


def misaligned(roll: float, pitch: float, yaw: float) -> Vector:
    """R_mis, the accelerometer's frame against the gyroscope's, of three angles [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, sr], [0, -sr, cr]])
    about_y = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    about_z = np.array([[cy, sy, 0], [-sy, cy, 0], [0, 0, 1]])
    product: Vector = about_x @ about_y @ about_z
    return product
