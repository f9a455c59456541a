"""What else a simulated hand does to a board: lever, sway, jerks, tremor. Knows no sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...data import Vector


@dataclass(frozen=True)
class Hand:
    """A hand's habits.

    Attributes
    ----------
    lever_m : least and most distance of the sensor from the pivot. wobble : rms of the pivot's travel over that.
    sway_mps2 : rms an axis of its acceleration while it moves, 0.5 to 4 Hz. jerks_per_s : likewise while it moves.
    tremor_mps2, tremor_rad_s : rms an axis while it holds a pose, 2 to 10 Hz; the acceleration is all, lever included.
    """

    lever_m: tuple[float, float] = (0.15, 0.3)
    wobble: float = 0.0
    sway_mps2: float = 0.3
    jerks_per_s: float = 0.3
    tremor_mps2: float = 0.0
    tremor_rad_s: float = 0.0

    def acceleration(
        self, omega: Vector, moving: Vector, holding: Vector, step_s: float, rng: np.random.Generator
    ) -> Vector:
        """The board's acceleration (n, 3) [m/s^2] in the body, turned by omega (n, 3) [rad/s] at steps of step_s.

        moving, holding : (n,) how much the hand moves or holds a pose, 0 to 1.
        """
        n = len(omega)
        a = lever_acceleration(omega, self._lever(moving, step_s, rng), step_s)
        a += self.sway_mps2 * moving[:, None] * band_noise(n, step_s, 0.5, 4.0, rng)
        a += self._jerks(moving, step_s, rng)
        a += self.tremor_mps2 * holding[:, None] * band_noise(n, step_s, 2.0, 10.0, rng)
        return a

    def tremor(self, holding: Vector, step_s: float, rng: np.random.Generator) -> Vector:
        """The rates (n, 3) [rad/s] of the tremor."""
        return self.tremor_rad_s * holding[:, None] * band_noise(len(holding), step_s, 2.0, 10.0, rng)

    def _lever(self, moving: Vector, step_s: float, rng: np.random.Generator) -> Vector:
        """Where the sensor is from the pivot (n, 3) [m], in the body."""
        direction = rng.standard_normal(3)
        length = rng.uniform(*self.lever_m)
        # an rms of wobble * length over three axes
        travel = self.wobble * length / np.sqrt(3.0) * moving[:, None] * band_noise(len(moving), step_s, 0.05, 0.4, rng)
        return np.asarray(length * direction / np.linalg.norm(direction) + travel)

    def _jerks(self, moving: Vector, step_s: float, rng: np.random.Generator) -> Vector:
        """Half sines of 2 to 6 m/s^2 and 60 to 120 ms that begin while the hand moves."""
        n = len(moving)
        a = np.zeros((n, 3))
        for start in np.flatnonzero(rng.random(n) < self.jerks_per_s * step_s * moving).tolist():
            length = min(int(rng.uniform(0.06, 0.12) / step_s), n - start)
            direction = rng.standard_normal(3)
            direction *= rng.uniform(2.0, 6.0) / np.linalg.norm(direction)
            a[start : start + length] += np.sin(np.pi * (np.arange(length) + 0.5) / length)[:, None] * direction
        return a


def lever_acceleration(omega: Vector, r: Vector, step_s: float) -> Vector:
    """The acceleration (n, 3) [m/s^2] in the body of a point r (n, 3) [m] of it, itself moving or not."""
    alpha, v = np.gradient(omega, step_s, axis=0), np.gradient(r, step_s, axis=0)
    a: Vector = np.cross(alpha, r) + np.cross(omega, np.cross(omega, r) + 2.0 * v) + np.gradient(v, step_s, axis=0)
    return a


def band_noise(n: int, step_s: float, low_hz: float, high_hz: float, rng: np.random.Generator) -> Vector:
    """(n, 3) Gaussian noise between two frequencies, of rms 1 an axis."""
    frequency = np.fft.rfftfreq(n, step_s)
    band = (frequency >= low_hz) & (frequency <= high_hz)
    spectrum = np.zeros((len(frequency), 3), complex)
    spectrum[band] = rng.standard_normal((band.sum(), 3)) + 1j * rng.standard_normal((band.sum(), 3))
    noise = np.fft.irfft(spectrum, n, axis=0)
    scaled: Vector = noise / np.sqrt((noise**2).mean(0))
    return scaled
