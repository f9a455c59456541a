"""What is true of a simulated sensor, and the counts it makes of a motion. Knows no register and no hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..data import STANDARD_GRAVITY_MPS2, Vector

Counts = NDArray[np.int16]

FULL_SCALE = 32768
TEMPERATURE_NOISE_C = 0.02

# The data sheets' noise densities: ug/sqrt(Hz), deg/s/sqrt(Hz).
NOISE_OF_6050, NOISE_OF_6500 = (400.0, 0.005), (300.0, 0.01)


@dataclass(frozen=True)
class Setting:
    """How the chip is set to measure.

    Attributes
    ----------
    rate_hz : nominal sample rate. accel_range_g, gyro_range_dps : full scales.
    accel_offset_g, gyro_offset_dps : (3,) what offset registers and self test add.
    lsb_per_c, zero_c : temperature is counts / lsb_per_c + zero_c.
    """

    rate_hz: float
    accel_range_g: float
    gyro_range_dps: float
    lsb_per_c: float
    zero_c: float
    accel_offset_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gyro_offset_dps: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def mps2_per_lsb(self) -> float:
        """m/s^2 of an accelerometer count, at the nominal scale."""
        return self.accel_range_g * STANDARD_GRAVITY_MPS2 / FULL_SCALE

    @property
    def rad_s_per_lsb(self) -> float:
        """rad/s of a gyroscope count, at the nominal scale (131 LSB/(deg/s) at 250 deg/s)."""
        return float(np.radians(self.gyro_range_dps / 250.0 / 131.0))


@dataclass(frozen=True)
class Response:
    """In counts: (f, w) times `matrix` (6, 7), plus `offset` (7,), plus noise of deviation `noise` (7,)."""

    matrix: Vector
    offset: Vector
    noise: Vector

    def counts(self, specific_force: Vector, omega: Vector, rng: np.random.Generator) -> Counts:
        """What the chip reports of the mean motion over each sample.

        Parameters
        ----------
        specific_force : (n, 3) m/s^2. omega : (n, 3) rad/s. rng : where the noise comes from.

        Returns
        -------
        (n, 7) int16 in register order: accelerometer x, y, z, temperature, gyroscope x, y, z; saturated.
        """
        exact = np.hstack((specific_force, omega)) @ self.matrix + self.offset
        noisy = exact + rng.standard_normal(exact.shape) * self.noise
        return np.minimum(np.maximum(np.rint(noisy), -FULL_SCALE), FULL_SCALE - 1).astype(np.int16)


@dataclass(frozen=True)
class Truth:
    """A sensor's true parameters, in the frame in which K is symmetric.

    Attributes
    ----------
    D, b_a : (3, 3), (3,) m/s^2: y = D s + b_a of specific force s (the paper's eq. 3).
    K, b_omega : (3, 3) symmetric, (3,) rad/s: w = K (y - b_omega).
    accel_noise_density, gyro_noise_density : m/s^2/sqrt(Hz), rad/s/sqrt(Hz).
    rate_error_ppm : how much faster than nominal the sample clock runs.
    gravity : m/s^2, where the sensor is. temperature_c : of the die.
    chip : its name. seed : what it was drawn from.
    """

    D: Vector
    b_a: Vector
    K: Vector
    b_omega: Vector
    accel_noise_density: float
    gyro_noise_density: float
    rate_error_ppm: float
    gravity: float
    temperature_c: float
    chip: str
    seed: int

    @classmethod
    def draw(cls, seed: int, chip: str = "mpu6050", gravity: float = STANDARD_GRAVITY_MPS2) -> Self:
        """A plausible sensor: uniform within the data sheets' tolerances.

        Gains +-3 %, cross-axis +-0.02 rad, misalignment +-2 deg, bias +-80 mg; gyro bias +-20 deg/s, its
        matrix +-3 % on and +-2 % off the diagonal; sample clock +-0.8 %.
        """
        rng = np.random.default_rng([seed, 1])
        zeta, eta, rho = rng.uniform(-0.02, 0.02, 3)
        skew = np.array(
            [
                [1.0, 0.0, 0.0],
                [np.sin(zeta), np.cos(zeta), 0.0],
                [-np.sin(eta), np.cos(eta) * np.sin(rho), np.cos(eta) * np.cos(rho)],
            ]
        )
        gains = np.diag(rng.uniform(0.97, 1.03, 3))
        D = gains @ skew @ rotation_matrix(np.radians(rng.uniform(-2, 2, 3)))
        gyro = rng.uniform(-0.02, 0.02, (3, 3))
        np.fill_diagonal(gyro, rng.uniform(0.97, 1.03, 3))
        D, K = in_symmetric_frame(D, np.linalg.inv(gyro))
        accel_noise, gyro_noise = NOISE_OF_6050 if chip.startswith("mpu6050") else NOISE_OF_6500
        return cls(
            D=D,
            b_a=rng.uniform(-0.08, 0.08, 3) * STANDARD_GRAVITY_MPS2,
            K=K,
            b_omega=np.radians(rng.uniform(-20, 20, 3)),
            accel_noise_density=accel_noise * 1e-6 * STANDARD_GRAVITY_MPS2,
            gyro_noise_density=float(np.radians(gyro_noise)),
            rate_error_ppm=float(np.round(rng.uniform(-8000, 8000))),
            gravity=gravity,
            temperature_c=float(np.round(rng.uniform(22, 34), 1)),
            chip=chip,
            seed=seed,
        )

    def response(self, setting: Setting) -> Response:
        """What the sensor makes of a motion, so set.

        A mean over one sample passes white noise up to half the sample rate.
        """
        band = np.sqrt(setting.rate_hz / 2)
        matrix, offset, noise = np.zeros((6, 7)), np.zeros(7), np.zeros(7)
        matrix[:3, :3] = self.D.T / setting.mps2_per_lsb
        matrix[3:, 4:] = np.linalg.inv(self.K).T / setting.rad_s_per_lsb
        accel_offset = np.array(setting.accel_offset_g) * STANDARD_GRAVITY_MPS2
        offset[:3] = (self.b_a + accel_offset) / setting.mps2_per_lsb
        offset[3] = (self.temperature_c - setting.zero_c) * setting.lsb_per_c
        offset[4:] = (self.b_omega + np.radians(setting.gyro_offset_dps)) / setting.rad_s_per_lsb
        noise[:3] = self.accel_noise_density * band / setting.mps2_per_lsb
        noise[3] = TEMPERATURE_NOISE_C * setting.lsb_per_c
        noise[4:] = self.gyro_noise_density * band / setting.rad_s_per_lsb
        return Response(matrix, offset, noise)

    def document(self) -> dict[str, Any]:
        """The truth in plain JSON types, in m/s^2, rad/s and the symmetric frame."""
        return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in self.__dict__.items()}


def in_symmetric_frame(D: Vector, K: NDArray[np.floating[Any]]) -> tuple[Vector, Vector]:
    """The same sensor in the frame that makes K symmetric: K = U S V^T, Q = V U^T, then D Q^T and Q K."""
    U, S, Vt = np.linalg.svd(K)
    symmetric = Vt.T @ np.diag(S) @ Vt
    return D @ U @ Vt, (symmetric + symmetric.T) / 2


def rotation_matrix(angles_rad: Vector) -> Vector:
    """Rx Ry Rz of three small angles [rad]."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles_rad), np.sin(angles_rad)
    Rx = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    Ry = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    Rz = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(Rx @ Ry @ Rz)
