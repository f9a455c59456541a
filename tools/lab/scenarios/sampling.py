"""Sampling of a motion on a fine clock: mount, filter, delay, clock, white noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

from mpucal.data import Vector


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
        return max(2, math.ceil(self.fine_hz / self.rate_hz))

    @property
    def step_s(self) -> float:
        """Return the true length of a fine step [s]."""
        return 1.0 / (self.rate_hz * (1.0 + self.clock_error) * self.per_sample)

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
        sos = butter(2, self.lowpass_hz, fs=1.0 / self.step_s, output="sos")
        settled = sosfilt_zi(sos)[:, :, None] * y[0]
        return np.asarray(sosfilt(sos, noisy, axis=0, zi=settled)[0][self.per_sample - 1 :: self.per_sample])

    def _mounted(self, y: Vector) -> Vector:
        """Filter by w^2 / (s^2 + w s / Q + w^2), by the bilinear transform."""
        k = 1.0 / np.tan(np.pi * self.mount_hz * self.step_s)
        a = np.array([k * k + k / self.mount_q + 1.0, 2.0 - 2.0 * k * k, k * k - k / self.mount_q + 1.0])
        sos = np.concatenate(([1.0, 2.0, 1.0], a))[None] / a[0]
        return np.asarray(sosfilt(sos, y, axis=0, zi=sosfilt_zi(sos)[:, :, None] * y[0])[0])
