"""What a sensor does besides D, b_a, K and b_omega, in SI units.

Each is a frozen dataclass; `spoil(readings, rng)` gives the readings so spoilt.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.signal import lfilter

from mpucal.data import STANDARD_GRAVITY_MPS2, Vector
from mpucal.simulated.sensor import SensorTruth

from .course import FLAT_S, direction


@dataclass(frozen=True)
class Readings:
    """What a sensor read.

    t : (m,) s, true. moving : (m,) 0 to 1. force : (m, 3) m/s^2, the specific force. acc, gyr : (m, 3) m/s^2, rad/s.
    temperature_c : (m,). truth : the sensor. ranges : its full scales [m/s^2, rad/s].
    """

    t: Vector
    moving: Vector
    force: Vector
    acc: Vector
    gyr: Vector
    temperature_c: Vector
    truth: SensorTruth
    ranges: tuple[float, float]

    def zero_moved(self, by: Vector) -> Readings:
        """The accelerometer's zero moves by (m, 3) m/s^2, and the true b_a by its mean after the flat segment."""
        mean = by[self.t >= FLAT_S].mean(axis=0)
        return replace(self, acc=self.acc + by, truth=replace(self.truth, b_a=self.truth.b_a + mean))

    def turning_share(self, share: float) -> float:
        """The time [s] at that share of what follows the flat segment."""
        return FLAT_S + share * (float(self.t[-1]) - FLAT_S)


class Fault(Protocol):
    """One thing that a sensor does."""

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """The readings with it."""
        ...


@dataclass(frozen=True)
class Nonlinear:
    """Each axis bends by up to `share` of full scale at full scale, as its square; the truth is the slope at zero."""

    share: float = 0.005

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        bend = self.share * rng.uniform(-1.0, 1.0, 3) / readings.ranges[0]
        return replace(readings, acc=readings.acc + bend * readings.acc**2)


@dataclass(frozen=True)
class GyroNonlinear:
    """Each gyroscope axis bends by `share` of full scale at full scale, as its cube."""

    share: float = 0.002

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        bend = self.share * rng.choice([-1.0, 1.0], 3) / readings.ranges[1] ** 2
        return replace(readings, gyr=readings.gyr + bend * readings.gyr**3)


@dataclass(frozen=True)
class SenseOfGravity:
    """Each gyroscope axis reads `dps_per_g` too, of acceleration along some direction."""

    dps_per_g: float = 0.1

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        G = np.radians(self.dps_per_g) * np.array([direction(rng) for _ in range(3)])
        return replace(readings, gyr=readings.gyr + readings.force @ G.T / STANDARD_GRAVITY_MPS2)


@dataclass(frozen=True)
class Hysteresis:
    """The accelerometer follows with a play of mps2 to either side."""

    mps2: float = 0.02

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        acc = np.empty_like(readings.acc)
        for axis in range(3):
            at, followed = float(readings.acc[0, axis]), []
            for y in readings.acc[:, axis].tolist():
                at = min(max(at, y - self.mps2), y + self.mps2)
                followed.append(at)
            acc[:, axis] = followed
        return replace(readings, acc=acc)


@dataclass(frozen=True)
class Flicker:
    """1/f noise beside the white: as strong as it at these corner frequencies [Hz]."""

    accel_hz: float = 3.0
    gyro_hz: float = 0.3

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        truth, step_s = readings.truth, float(np.median(np.diff(readings.t)))
        n = len(readings.t)
        frequency = np.fft.rfftfreq(n, step_s)
        frequency[0] = np.inf

        def noise(density: float | Vector, corner_hz: float) -> Vector:
            lines = rng.standard_normal((len(frequency), 3)) + 1j * rng.standard_normal((len(frequency), 3))
            # a density d is d^2 / (2 step) n |line|^2 / 2 of an unnormalised transform
            size = np.sqrt(corner_hz / frequency) * np.sqrt(n / step_s) / 2.0
            return np.asarray(density * np.fft.irfft(lines * size[:, None], n, axis=0))

        acc = readings.acc + noise(truth.accel_noise_density, self.accel_hz)
        return replace(readings, acc=acc, gyr=readings.gyr + noise(truth.gyro_noise_density, self.gyro_hz))


@dataclass(frozen=True)
class Swapped:
    """The accelerometer's x and y are swapped; with `sign` -1 turned by 90 deg, which leaves it right-handed."""

    sign: float = 1.0

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        P, truth = np.array([[0.0, self.sign, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), readings.truth
        return replace(readings, acc=readings.acc @ P.T, truth=replace(truth, D=P @ truth.D, b_a=P @ truth.b_a))


@dataclass(frozen=True)
class CrossClipped:
    """Where an axis is beyond its range, the others are off by mps2, and recover within 20 ms."""

    mps2: float = 1.0

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        beyond = (np.abs(readings.acc) > readings.ranges[0]).any(axis=1).astype(float)
        step_s = float(np.median(np.diff(readings.t)))
        keep = np.exp(-step_s / 0.02)
        lasting = np.minimum(lfilter([1.0], [1.0, -keep], beyond), 1.0)
        return replace(readings, acc=readings.acc + self.mps2 * lasting[:, None] * rng.choice([-1.0, 1.0], 3))


@dataclass(frozen=True)
class Hobby:
    """What sketches do before they print: average the accelerometer over 1 / smooth samples, and take gyroscope rates
    below dead_dps, about the mean of the flat segment, for none."""

    smooth: float = 1.0
    dead_dps: float = 0.0

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        acc, flat = readings.acc, readings.t < 0.3 * FLAT_S
        acc = acc[:1] + lfilter([self.smooth], [1.0, self.smooth - 1.0], acc - acc[:1], axis=0)
        zero = readings.gyr[flat].mean(axis=0)
        rates = readings.gyr - zero
        return replace(readings, acc=acc, gyr=zero + rates * (np.abs(rates) >= np.radians(self.dead_dps)))


@dataclass(frozen=True)
class Ripple:
    """The supply's ripple reaches the accelerometer: one line of mps2 at hz as it is aliased, from the start."""

    mps2: float = 0.3
    hz: float = 1.7

    def spoil(self, readings: Readings, rng: np.random.Generator) -> Readings:
        """See Fault."""
        wave = np.sin(2 * np.pi * self.hz * readings.t + rng.uniform(0, 2 * np.pi))
        return replace(readings, acc=readings.acc + self.mps2 * wave[:, None] * direction(rng))
