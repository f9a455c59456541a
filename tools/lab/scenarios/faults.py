"""Errors of a sensor besides D, b_a, K and b_omega, their changes while it is turned, and damage on the way to a file.

Faults are functions of the readings, in SI units, and a generator, and give the readings so spoilt. Where D or b_a
moves, what is compared as the truth is its mean over the recording after the flat segment. A fault of 16-bit words
takes and gives (n, 6) int32: the accelerometer's x, y, z, then the gyroscope's. A fault of times takes the nominal
times (n,) [s] of the samples, and gives the times (m,) that are written, and the numbers (m,) of the samples beside
them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from mpucal.data import STANDARD_GRAVITY_MPS2, Vector
from mpucal.simulated.sensor import SensorTruth

from .course import FLAT_S, Rng, direction
from .sensors import Counts

MG_MPS2 = 1e-3 * STANDARD_GRAVITY_MPS2


@dataclass(frozen=True)
class Readings:
    """Readings of a sensor.

    t : (m,) s, true. moving : (m,) 0 to 1. force : (m, 3) m/s^2, the specific force. acc, gyr : (m, 3) m/s^2, rad/s.
    temperature_c : (m,). truth : the sensor. ranges : its full scales [m/s^2, rad/s].
    slipped : the sensor before and after its mount slipped.
    """

    t: Vector
    moving: Vector
    force: Vector
    acc: Vector
    gyr: Vector
    temperature_c: Vector
    truth: SensorTruth
    ranges: tuple[float, float]
    slipped: tuple[SensorTruth, ...] = ()

    def zero_moved(self, by: Vector) -> Readings:
        """Move the accelerometer's zero by (m, 3) m/s^2, and the true b_a by its mean after the flat segment."""
        mean = by[self.t >= FLAT_S].mean(axis=0)
        return replace(self, acc=self.acc + by, truth=self.truth._replace(b_a=self.truth.b_a + mean))

    def turning_share(self, share: float) -> float:
        """Return the time [s] at that share of what follows the flat segment."""
        return FLAT_S + share * (float(self.t[-1]) - FLAT_S)


Fault = Callable[[Readings, Rng], Readings]


def nonlinear(readings: Readings, rng: Rng, share: float = 0.005) -> Readings:
    """Bend each axis by up to `share` of full scale at full scale, as its square.

    The truth is the linear sensor that is nearest over all directions of gravity.
    """
    bend, truth = share * rng.uniform(-1.0, 1.0, 3) / readings.ranges[0], readings.truth
    D = truth.D * (1.0 + 2.0 * bend * truth.b_a)[:, None]
    b_a = truth.b_a + bend * (truth.b_a**2 + truth.gravity**2 / 3.0 * np.sum(truth.D**2, axis=1))
    return replace(readings, acc=readings.acc + bend * readings.acc**2, truth=truth._replace(D=D, b_a=b_a))


def gyro_nonlinear(readings: Readings, rng: Rng, share: float = 0.002) -> Readings:
    """Bend each gyroscope axis by `share` of full scale at full scale, as its cube."""
    bend = share * rng.choice([-1.0, 1.0], 3) / readings.ranges[1] ** 2
    return replace(readings, gyr=readings.gyr + bend * readings.gyr**3)


def sense_of_gravity(readings: Readings, rng: Rng, dps_per_g: float = 0.1) -> Readings:
    """Add `dps_per_g` to each gyroscope axis, of acceleration along some direction."""
    G = np.radians(dps_per_g) * np.array([direction(rng) for _ in range(3)])
    return replace(readings, gyr=readings.gyr + readings.force @ G.T / STANDARD_GRAVITY_MPS2)


def hysteresis(readings: Readings, rng: Rng, mps2: float = 0.02) -> Readings:
    """Have the accelerometer follow with a play of mps2 to either side."""
    acc = np.empty_like(readings.acc)
    for axis in range(3):
        at, followed = float(readings.acc[0, axis]), []
        for y in readings.acc[:, axis].tolist():
            at = min(max(at, y - mps2), y + mps2)
            followed.append(at)
        acc[:, axis] = followed
    return replace(readings, acc=acc)


def flicker(readings: Readings, rng: Rng, accel_hz: float = 3.0, gyro_hz: float = 0.3) -> Readings:
    """Add 1/f noise to the white: as strong as it at these corner frequencies [Hz]."""
    truth, step_s = readings.truth, float(np.median(np.diff(readings.t)))
    n = len(readings.t)
    frequency = np.fft.rfftfreq(n, step_s)
    frequency[0] = np.inf

    def noise(density: float | Vector, corner_hz: float) -> Vector:
        lines = rng.standard_normal((len(frequency), 3)) + 1j * rng.standard_normal((len(frequency), 3))
        # a density d is d^2 / (2 step) n |line|^2 / 2 of an unnormalised transform
        size = np.sqrt(corner_hz / frequency) * np.sqrt(n / step_s) / 2.0
        return np.asarray(density * np.fft.irfft(lines * size[:, None], n, axis=0))

    acc = readings.acc + noise(truth.accel_noise_density, accel_hz)
    return replace(readings, acc=acc, gyr=readings.gyr + noise(truth.gyro_noise_density, gyro_hz))


def swapped(readings: Readings, rng: Rng, sign: float = 1.0) -> Readings:
    """Swap the accelerometer's x and y; with `sign` -1 turned by 90 deg, which leaves it right-handed."""
    P, truth = np.array([[0.0, sign, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), readings.truth
    return replace(readings, acc=readings.acc @ P.T, truth=truth._replace(D=P @ truth.D, b_a=P @ truth.b_a))


def cross_clipped(readings: Readings, rng: Rng, mps2: float = 1.0) -> Readings:
    """Push the other axes off by mps2 where one is beyond its range; they recover within 20 ms."""
    beyond = (np.abs(readings.acc) > readings.ranges[0]).any(axis=1).astype(float)
    step_s = float(np.median(np.diff(readings.t)))
    keep = np.exp(-step_s / 0.02)
    lasting = np.minimum(scipy.signal.lfilter([1.0], [1.0, -keep], beyond), 1.0)
    return replace(readings, acc=readings.acc + mps2 * lasting[:, None] * rng.choice([-1.0, 1.0], 3))


def hobby(readings: Readings, rng: Rng, smooth: float = 1.0, dead_dps: float = 0.0) -> Readings:
    """Do as sketches do before they print: smooth the accelerometer, and remove small rates.

    smooth : accelerations are averaged over 1 / smooth samples. dead_dps : rates nearer than this to the mean of the
    flat segment are set to it.
    """
    acc, flat = readings.acc, readings.t < 0.3 * FLAT_S
    acc = acc[:1] + scipy.signal.lfilter([smooth], [1.0, smooth - 1.0], acc - acc[:1], axis=0)
    zero = readings.gyr[flat].mean(axis=0)
    rates = readings.gyr - zero
    return replace(readings, acc=acc, gyr=zero + rates * (np.abs(rates) >= np.radians(dead_dps)))


def ripple(readings: Readings, rng: Rng, mps2: float = 0.3, hz: float = 1.7) -> Readings:
    """Add the supply's ripple to the accelerometer: one line of mps2 at hz as it is aliased, from the start."""
    wave = np.sin(2 * np.pi * hz * readings.t + rng.uniform(0, 2 * np.pi))
    return replace(readings, acc=readings.acc + mps2 * wave[:, None] * direction(rng))


def gyro_moves(readings: Readings, rng: Rng, drift_dps: float = 0.0, step_dps: float = 0.0) -> Readings:
    """Move the gyroscope's bias: it drifts by drift_dps in 90 s, and steps by step_dps midway."""
    drift = drift_dps / 90.0 * readings.t[:, None] * direction(rng)
    stepped = readings.t > readings.turning_share(rng.uniform(0.3, 0.7))
    step = step_dps * stepped[:, None] * direction(rng)
    return replace(readings, gyr=readings.gyr + np.radians(drift + step))


def gyro_feels(readings: Readings, rng: Rng, dps_per_g: float = 0.05) -> Readings:
    """Add a sensitivity to acceleration to the rates: of each axis to each, dps_per_g rms."""
    sensitivity = np.radians(dps_per_g) / STANDARD_GRAVITY_MPS2 * rng.standard_normal((3, 3))
    return replace(readings, gyr=readings.gyr + readings.force @ sensitivity.T)


def zero_step(readings: Readings, rng: Rng, mg: float = 10.0) -> Readings:
    """Step the accelerometer's zero by `mg` in some direction, midway."""
    after = readings.t > readings.turning_share(rng.uniform(0.3, 0.7))
    return readings.zero_moved(mg * MG_MPS2 * after[:, None] * direction(rng))


def stress(readings: Readings, rng: Rng, mg: float = 3.0) -> Readings:
    """Bend the board by how it is held: in each pose the accelerometer's zero is elsewhere, by `mg` rms an axis."""
    pose = np.cumsum(np.diff((readings.moving > 0.5).astype(int), prepend=0) > 0)
    zeros = mg * MG_MPS2 * rng.standard_normal((pose[-1] + 1, 3))
    return readings.zero_moved(zeros[pose])


def warming(
    readings: Readings,
    rng: Rng,
    by_c: float = 20.0,
    tau_s: float = 300.0,
    mg_per_c: float = 0.8,
    dps_per_c: float = 0.02,
) -> Readings:
    """Warm by `by_c` with a time constant of tau_s; both biases follow, within what data sheets allow."""
    warmer = by_c * (1.0 - np.exp(-readings.t / tau_s))[:, None]
    moved = readings.zero_moved(mg_per_c * MG_MPS2 * rng.uniform(-1, 1, 3) * warmer)
    gyr = readings.gyr + np.radians(dps_per_c) * rng.uniform(-1, 1, 3) * warmer
    return replace(moved, gyr=gyr, temperature_c=readings.temperature_c + warmer[:, 0])


def slip(readings: Readings, rng: Rng, deg: float = 3.0) -> Readings:
    """Slip the accelerometer on its mount by `deg` midway; the gyroscope does not; the true D is the mean."""
    after = readings.t > readings.turning_share(rng.uniform(0.3, 0.7))
    turn = np.cross(np.eye(3), np.radians(deg) * direction(rng))
    D, share = readings.truth.D, after[readings.t >= FLAT_S].mean()
    acc = readings.acc + after[:, None] * (readings.force @ (D @ turn).T)
    before, mean, end = (readings.truth._replace(D=D + of_turn * D @ turn) for of_turn in (0.0, share, 1.0))
    return replace(readings, acc=acc, truth=mean, slipped=(before, end))


def teleport(readings: Readings, rng: Rng, seconds: float = 8.0) -> Readings:
    """Reset a simulator: for the last `seconds` the board is back where it lay, and no rate told of the way."""
    n = int(np.searchsorted(readings.t, seconds))
    acc, gyr = readings.acc.copy(), readings.gyr.copy()
    acc[-n:], gyr[-n:] = acc[:n], gyr[:n]
    return replace(readings, acc=acc, gyr=gyr)


Written = tuple[Vector, NDArray[np.intp]]
Digits = Callable[[Counts, Rng], Counts]
Timing = Callable[[Vector, Rng], Written]

LOW = 0xFF
# of times that must increase
LEAST_S = 1e-5


def low_byte_zero(counts: Counts, rng: Rng) -> Counts:
    """Clear the low byte of one accelerometer axis."""
    counts[:, rng.integers(3)] &= ~LOW
    return counts


def flipped(counts: Counts, rng: Rng, per_byte: float = 1.0 / 2000.0) -> Counts:
    """Flip a bit of each byte with this probability."""
    words = counts.astype(np.int16).view(np.uint16)
    for byte in (0, 8):
        hit = rng.random(words.shape) < per_byte
        words[hit] ^= (1 << rng.integers(byte, byte + 8, int(hit.sum()))).astype(np.uint16)
    return words.view(np.int16).astype(np.int32)


def torn(counts: Counts, rng: Rng, share: float = 0.02) -> Counts:
    """Read high and low byte one after the other: with this probability the high one is of the sample before."""
    late = rng.random(counts.shape) < share
    late[0] = False
    before = np.roll(counts, 1, axis=0)
    return np.where(late, (before & ~LOW) | (counts & LOW), counts)


def signed_low(counts: Counts, rng: Rng) -> Counts:
    """Read the low byte as a signed number: where it is 128 or more, the word is 256 too small."""
    return counts - 256 * ((counts & LOW) >= 128)


def jitter(t: Vector, rng: Rng, rms_s: float = 0.002) -> Written:
    """Add to each time a Gaussian error of rms_s; they are in order."""
    return increasing(np.sort(t + rms_s * rng.standard_normal(len(t)))), np.arange(len(t))


def ticks(t: Vector, rng: Rng, tick_s: float = 0.004) -> Written:
    """Round times to whole ticks; a sample that falls into the tick of the one before is lost."""
    whole, rows = np.unique(np.floor((t + rng.uniform(0, tick_s)) / tick_s), return_index=True)
    return whole * tick_s, rows


def bursts(t: Vector, rng: Rng, count: int = 8, late_s: float = 0.004) -> Written:
    """Stamp samples as they come over a link that delivers `count` at once."""
    burst, place = np.divmod(np.arange(len(t)), count)
    arrived = t[np.minimum((burst + 1) * count, len(t)) - 1] + late_s * rng.random(burst[-1] + 1)[burst]
    return increasing(arrived + 5e-5 * place), np.arange(len(t))


def dropped(t: Vector, rng: Rng, share: float = 0.05, stretch_s: float = 0.0) -> Written:
    """Lose a share of the samples, and one stretch of stretch_s; times are right."""
    start = rng.uniform(0.3, 0.9) * t[-1]
    kept = (rng.random(len(t)) >= share) & ((t < start) | (t >= start + stretch_s))
    return t[kept], np.flatnonzero(kept)


def each_twice(t: Vector, rng: Rng) -> Written:
    """Read at twice the rate at which it measures: every sample comes twice, at evenly spaced times."""
    half = 0.5 * float(np.median(np.diff(t)))
    return np.stack((t, t + half), axis=1).ravel(), np.repeat(np.arange(len(t)), 2)


def polled(t: Vector, rng: Rng, poll_hz: float = 230.0, late_s: float = 0.0005) -> Written:
    """Read the newest sample in a loop at its own rate of poll_hz, late by up to late_s, and write its own time."""
    n = int((t[-1] - t[0]) * poll_hz)
    times = t[0] + np.arange(n) / poll_hz + late_s * rng.random(n)
    return times, np.searchsorted(t, times, side="right") - 1


def increasing(t: Vector) -> Vector:
    """Return the times, each LEAST_S after the one before it at least."""
    least = LEAST_S * np.arange(len(t))
    return np.asarray(np.maximum.accumulate(t - least) + least)
