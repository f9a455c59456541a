"""Simulated sensor: its true parameters, its response to a motion, and the feed of a simulated chip."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from ..chip.families import MPU6050, MPU6500
from ..data import ACCEL_COUNTS, STANDARD_GRAVITY_MPS2, Vector, mps2_per_count, rad_s_per_count
from ..result.document import plain
from ..result.error_model import to_body_frame
from .motion import Motion

Counts = NDArray[np.int16]

FULL_SCALE = int(ACCEL_COUNTS)
TEMPERATURE_NOISE_C = 0.02


class Setting(NamedTuple):
    """Settings of the chip.

    Attributes
    ----------
    rate_hz : nominal sample rate. accel_range_g, gyro_range_dps : full scales.
    accel_offset_g, gyro_offset_dps : (3,) added by offset registers and self test.
    lsb_per_c, zero_c : temperature is counts / lsb_per_c + zero_c.
    accel_lag_s : delay of the accelerometer against the gyroscope by its filters.
    """

    rate_hz: float
    accel_range_g: float
    gyro_range_dps: float
    lsb_per_c: float
    zero_c: float
    accel_offset_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gyro_offset_dps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accel_lag_s: float = 0.0

    @property
    def mps2_per_lsb(self) -> float:
        """Nominal m/s^2 of an accelerometer count."""
        return mps2_per_count(self.accel_range_g)

    @property
    def rad_s_per_lsb(self) -> float:
        """Nominal rad/s of a gyroscope count (131 LSB/(deg/s) at 250 deg/s)."""
        return rad_s_per_count(self.gyro_range_dps)


class SensorResponse(NamedTuple):
    """Response in counts: (f, w) times `matrix` (6, 7) + `offset` (7,) + noise of standard deviation `noise` (7,)."""

    matrix: Vector
    offset: Vector
    noise: Vector

    def counts(self, specific_force: Vector, omega: Vector, rng: np.random.Generator) -> Counts:
        """Return the chip's samples of the mean motion over each sample.

        Parameters
        ----------
        specific_force : (n, 3) m/s^2. omega : (n, 3) rad/s. rng : of the noise.

        Returns
        -------
        (n, 7) int16 in register order: accelerometer x, y, z, temperature, gyroscope x, y, z; saturated.
        """
        exact = np.concatenate((specific_force, omega), axis=1) @ self.matrix + self.offset
        noisy = exact + rng.standard_normal(exact.shape) * self.noise
        return np.minimum(np.maximum(np.rint(noisy), -FULL_SCALE), FULL_SCALE - 1).astype(np.int16)


class SensorTruth(NamedTuple):
    """A sensor's true parameters.

    Attributes
    ----------
    D, b_a : (3, 3), (3,) m/s^2: y = D s + b_a of specific force s (the paper's eq. 3).
    K, b_omega : (3, 3), (3,) rad/s: w = K (y - b_omega).
    gravity : m/s^2 at the sensor.
    accel_noise_density, gyro_noise_density : m/s^2/sqrt(Hz), rad/s/sqrt(Hz), of all axes or of each (3,).
    rate_error_ppm : of the sample clock, positive if it is fast.
    temperature_c : of the die. chip : its name. seed : from which it was drawn.
    """

    D: Vector
    b_a: Vector
    K: Vector
    b_omega: Vector
    gravity: float = STANDARD_GRAVITY_MPS2
    accel_noise_density: float | Vector = 0.0
    gyro_noise_density: float | Vector = 0.0
    rate_error_ppm: float = 0.0
    temperature_c: float = 25.0
    chip: str = ""
    seed: int = 0

    @classmethod
    def draw(cls, seed: int, chip: str = "mpu6050", gravity: float = STANDARD_GRAVITY_MPS2) -> Self:
        """Draw a sensor within its data sheet: each parameter uniform within the tolerance that its family has.

        D and K are drawn in the frame in which K is symmetric; sample clock +-0.8 %.
        """
        rng = np.random.default_rng([seed, 1])
        family = MPU6050 if chip.startswith("mpu6050") else MPU6500
        scale, cross = 0.01 * family.scale_percent, 0.01 * family.cross_axis_percent
        below, gains, above = (rng.uniform(-most, most, 3) for most in (cross, scale, cross))
        D = np.eye(3)
        D[np.tril_indices(3, -1)], D[np.triu_indices(3, 1)] = below, above
        D *= 1.0 + gains[:, None]
        gyro = rng.uniform(-cross, cross, (3, 3))
        np.fill_diagonal(gyro, rng.uniform(1.0 - scale, 1.0 + scale, 3))
        D, K, _ = to_body_frame(D, np.linalg.inv((gyro + gyro.T) / 2))
        return cls(
            D=D,
            b_a=rng.uniform(-1e-3, 1e-3, 3) * family.zero_g_mg * STANDARD_GRAVITY_MPS2,
            K=K,
            b_omega=np.radians(family.zero_rate_dps * rng.uniform(-1, 1, 3)),
            gravity=gravity,
            accel_noise_density=family.accel_noise_ug * 1e-6 * STANDARD_GRAVITY_MPS2,
            gyro_noise_density=float(np.radians(family.gyro_noise_dps)),
            rate_error_ppm=float(np.round(rng.uniform(-8000, 8000))),
            temperature_c=float(np.round(rng.uniform(22, 34), 1)),
            chip=chip,
            seed=seed,
        )

    def response(self, setting: Setting) -> SensorResponse:
        """Return the sensor's response under a setting.

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
        return SensorResponse(matrix, offset, noise)

    def document(self) -> dict[str, Any]:
        """Return the truth in plain JSON types, in m/s^2, rad/s and the symmetric frame."""
        return {key: plain(value) for key, value in self._asdict().items()}

    def symmetric(self) -> tuple[Self, Vector]:
        """Return this sensor in the body frame in which K is symmetric, and Q, the rotation to that frame."""
        D, K, Q = to_body_frame(self.D, self.K)
        return self._replace(D=D, K=K), Q


def density(std: Vector, rate_hz: float) -> Vector:
    """Return the noise density at which a sample at `rate_hz` has the standard deviation `std`."""
    return np.asarray(std / np.sqrt(rate_hz / 2.0))


class Feed(Protocol):
    """Source of the next samples, at the chip's sample clock."""

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """Return (n, 7) int16 in register order between (n + 1,) times [s]; fewer at the feed's end."""


class SensorFeed:
    """Feed of a sensor of known truth in motion."""

    def __init__(self, truth: SensorTruth, motion: Motion, rng: np.random.Generator) -> None:
        self._truth, self._motion, self._rng = truth, motion, rng
        self._set: tuple[Setting, SensorResponse] | None = None

    def samples(self, edges_s: Vector, setting: Setting) -> Counts:
        """Return the samples between (n + 1,) times [s]; the feed never ends."""
        if self._set is None or self._set[0] is not setting:
            self._set = setting, self._truth.response(setting)
        counts = self._set[1].counts(*self._motion.means(edges_s, setting.accel_lag_s), self._rng)
        if self._motion.mishaps:
            warmer = np.rint(self._motion.warmer_c(edges_s) * setting.lsb_per_c).astype(np.int16)
            counts[:, 3] += warmer
        return counts
