"""Sensors drawn: those of the paper's section 4.3, an MPU-6050 as it is sold, any chip; and how they are sampled."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from mpucal.calibration.rotation import rotation
from mpucal.data import STANDARD_GRAVITY_MPS2, Mask, Vector
from mpucal.simulated.sensor import SensorTruth, density

Counts = NDArray[np.int32]

GRAVITY_MPS2 = 9.82


def paper_sensor(rng: np.random.Generator, rate_hz: float = 100.0) -> SensorTruth:
    """Draw a sensor of the paper's section 4.3: a gyroscope that is ideal but for its bias, an accelerometer far off.

    The paper draws the noise of a sample, which is then the same at any `rate_hz`.
    """
    return SensorTruth(
        D=draw_D(rng, 0.5, np.radians(30.0), np.radians(10.0)),
        b_a=rng.uniform(-1, 1, 3),
        K=np.eye(3),
        b_omega=rng.uniform(-1, 1, 3),
        gravity=GRAVITY_MPS2,
        accel_noise_density=density(np.sqrt(rng.uniform(1e-3, 1e-1, 3)), rate_hz),
        gyro_noise_density=density(np.sqrt(rng.uniform(1e-3, 1e-2, 3)), rate_hz),
    )


@dataclass(frozen=True)
class Chip:
    """A kind of sensor and how it is set; errors are drawn uniformly within what is given, an MPU-6050's by default.

    Attributes
    ----------
    gain, cross, misaligned_deg, bias_mg : of the accelerometer, relative, rad, deg and mg.
    gyro_gain, gyro_cross, gyro_bias_dps : of the gyroscope.
    accel_noise_ug, gyro_noise_dps : densities, per sqrt(Hz). noisier : each sensor's own in units of that.
    accel_range_g, gyro_range_dps, bits : as it is set; 0 bits: floating point of no limit.
    steps : m/s^2 and rad/s of a count, where that does not follow from range and bits, as in a log of few decimals.
    name, message : what the recording says it is, and which MAVLink message carried it.
    """

    gain: float = 0.03
    cross: float = 0.02
    misaligned_deg: float = 2.0
    bias_mg: float = 80.0
    gyro_gain: float = 0.03
    gyro_cross: float = 0.02
    gyro_bias_dps: float = 20.0
    accel_noise_ug: float = 400.0
    gyro_noise_dps: float = 0.005
    accel_range_g: float = 4.0
    gyro_range_dps: float = 500.0
    bits: int = 16
    steps: tuple[float, float] | None = None
    name: str | None = "MPU-6050"
    message: str | None = None
    noisier: tuple[float, float] = (0.7, 1.4)

    def draw(self, rng: np.random.Generator, gravity: float = GRAVITY_MPS2) -> SensorTruth:
        """Draw a sensor, in the gyroscope's own frame."""
        D = draw_D(rng, self.gain, self.cross, np.radians(self.misaligned_deg))
        b_a = rng.uniform(-self.bias_mg, self.bias_mg, 3) * 1e-3 * STANDARD_GRAVITY_MPS2
        b_omega = np.radians(rng.uniform(-self.gyro_bias_dps, self.gyro_bias_dps, 3))
        gains, crosses = (rng.uniform(-most, most, (3, 3)) for most in (self.gyro_gain, self.gyro_cross))
        noisy = rng.uniform(*self.noisier, 2)
        return SensorTruth(
            D=D,
            b_a=b_a,
            K=np.asarray(np.linalg.inv(np.eye(3) + np.where(np.eye(3, dtype=bool), gains, crosses))),
            b_omega=b_omega,
            gravity=gravity,
            accel_noise_density=self.accel_noise_ug * noisy[0] * 1e-6 * STANDARD_GRAVITY_MPS2,
            gyro_noise_density=float(np.radians(self.gyro_noise_dps * noisy[1])),
        )

    @property
    def ranges(self) -> tuple[float, float]:
        """Return the full scales [m/s^2, rad/s]."""
        return self.accel_range_g * STANDARD_GRAVITY_MPS2, float(np.radians(self.gyro_range_dps))

    @property
    def step(self) -> Vector:
        """Return the size (6,) of a count: the accelerometer's axes [m/s^2], then the gyroscope's [rad/s]."""
        accel, gyro = self.steps or (full / 2.0 ** (self.bits - 1) for full in self.ranges)
        return np.repeat([accel, gyro], 3)

    def counts(self, y: Vector) -> tuple[Counts, Mask]:
        """Return y (n, 6) in counts, and which (n, 6) stand at the end of their range."""
        end = 2 ** (self.bits - 1)
        counts = np.clip(np.rint(y / self.step), -end, end - 1).astype(np.int32)
        return counts, (counts == -end) | (counts == end - 1)


# an MPU-6050 as they are sold, at 2 g
BY_HAND = Chip(noisier=(1.0, 1.0), accel_range_g=2.0)
hand_sensor = BY_HAND.draw


@dataclass(frozen=True)
class Sampling:
    """The way in which a motion is sampled.

    Attributes
    ----------
    rate_hz : nominal. clock_error : relative, by how much the true rate is higher, while times are nominal.
    lowpass_hz : corner of a second-order Butterworth filter, of which samples are points; 0: means over a sample.
    delay_ms : by how much the accelerometer's samples are older than the gyroscope's.
    mount_hz, mount_q : resonance of the accelerometer's mount; 0 Hz: rigid.
    fine_hz : the least rate of the fine clock.
    """

    rate_hz: float = 200.0
    clock_error: float = 0.0
    lowpass_hz: float = 0.0
    delay_ms: float = 0.0
    mount_hz: float = 0.0
    mount_q: float = 8.0
    fine_hz: float = 2000.0

    @property
    def per_sample(self) -> int:
        """Return the fine steps in a sample."""
        return max(1, math.ceil(self.fine_hz / self.rate_hz))

    @property
    def step_s(self) -> float:
        """Return the true length of a fine step [s]."""
        return 1.0 / (self.rate_hz * (1.0 + self.clock_error) * self.per_sample)

    def measured(
        self, truth: SensorTruth, force: Vector, omega: Vector, rng: np.random.Generator
    ) -> tuple[Vector, Vector]:
        """Return what the sensor reads (m, 3) [m/s^2, rad/s] of specific force and rates (n, 3)."""
        acc = self.accelerometer(force @ truth.D.T + truth.b_a, truth.accel_noise_density, rng)
        return acc, self.gyroscope(omega @ np.linalg.inv(truth.K).T + truth.b_omega, truth.gyro_noise_density, rng)

    def accelerometer(self, y: Vector, density: float | Vector, rng: np.random.Generator) -> Vector:
        """Return samples (m, 3) of y (n, 3), through its mount, late and noisy."""
        if self.mount_hz:
            y = self._mounted(y)
        late = round(self.delay_ms * 1e-3 / self.step_s)
        if late:
            y = np.concatenate((np.repeat(y[:1], late, axis=0), y[:-late]))
        return self.gyroscope(y, density, rng)

    def gyroscope(self, y: Vector, density: float | Vector, rng: np.random.Generator) -> Vector:
        """Return samples (m, 3) of y (n, 3), noisy by `density` [/sqrt(Hz)]."""
        n = len(y) // self.per_sample
        y = y[: n * self.per_sample]
        if not self.lowpass_hz:
            noise = rng.standard_normal((n, 3)) * (density * np.sqrt(0.5 / (self.step_s * self.per_sample)))
            # as one product: NumPy's mean over the middle axis is five times as slow
            mean = np.tile(np.eye(3) / self.per_sample, (self.per_sample, 1))
            return np.asarray(y.reshape(n, -1) @ mean + noise)
        noisy = y + rng.standard_normal(y.shape) * (density * np.sqrt(0.5 / self.step_s))
        sos = scipy.signal.butter(2, self.lowpass_hz, fs=1.0 / self.step_s, output="sos")
        settled = scipy.signal.sosfilt_zi(sos)[:, :, None] * y[0]
        filtered = scipy.signal.sosfilt(sos, noisy, axis=0, zi=settled)[0]
        return np.asarray(filtered[self.per_sample - 1 :: self.per_sample])

    def _mounted(self, y: Vector) -> Vector:
        """Filter by w^2 / (s^2 + w s / Q + w^2), by the bilinear transform."""
        k = 1.0 / np.tan(np.pi * self.mount_hz * self.step_s)
        a = np.array([k * k + k / self.mount_q + 1.0, 2.0 - 2.0 * k * k, k * k - k / self.mount_q + 1.0])
        sos = np.concatenate(([1.0, 2.0, 1.0], a))[None] / a[0]
        settled = scipy.signal.sosfilt_zi(sos)[:, :, None] * y[0]
        return np.asarray(scipy.signal.sosfilt(sos, y, axis=0, zi=settled)[0])


def non_orthogonality(zeta: float, eta: float, rho: float) -> Vector:
    """Return C_no of Kok and Schön (2014), section 4.3, of skewed axes [rad]."""
    return np.array(
        [
            [1.0, 0.0, 0.0],
            [np.sin(zeta), np.cos(zeta), 0.0],
            [-np.sin(eta), np.cos(eta) * np.sin(rho), np.cos(eta) * np.cos(rho)],
        ]
    )


def euler_rotation(angles_rad: Vector) -> Vector:
    """Return Rx Ry Rz of three angles [rad]."""
    x, y, z = rotation(np.diag(angles_rad))
    return np.asarray(x @ y @ z)


def draw_D(rng: np.random.Generator, gain: float, skew_rad: float, misaligned_rad: float) -> Vector:  # noqa: N802
    """Draw D of scale factor errors, skewed axes and a misalignment, uniform within these limits."""
    gains, skew = 1.0 + rng.uniform(-gain, gain, 3), rng.uniform(-skew_rad, skew_rad, 3)
    turn = rng.uniform(-misaligned_rad, misaligned_rad, 3)
    return np.asarray(np.diag(gains) @ non_orthogonality(*skew) @ euler_rotation(-turn))
