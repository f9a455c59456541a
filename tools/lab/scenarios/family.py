"""A family of hands and sensors, and the recording with known truth that a seed draws of it."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from mpucal.data import Recording, Sensor
from mpucal.simulated import rotation
from mpucal.simulated.sensor import SensorTruth

from .around import Around, Hand
from .body import attitudes, specific_force
from .course import Course, Motion, Rng, poses
from .faults import Digits, Fault, Readings, Timing
from .sensors import Chip, Sampling

GRAVITY_MPS2 = 9.81
TEMPERATURE_C = 25.0


class Wanted(Enum):
    """The verdicts that a family is to have, besides true ones."""

    GOOD = "good"
    SHARP = "good, to 1 mm/s²"
    HONEST = "any"


_USUAL, _MPU6050, _AT_200_HZ = Hand(), Chip(), Sampling()
PLAIN, SHARP, HONEST = Wanted.GOOD, Wanted.SHARP, Wanted.HONEST


@dataclass(frozen=True)
class Family:
    """Hands and sensors of one kind.

    Attributes
    ----------
    name : without a semicolon. wanted : of the verdicts; a false one is never right.
    motion : how the board is turned. hand : what holds it. around : what moves it besides.
    chip, sampling : the sensor and how it is sampled.
    faults, digits, timing : what befalls values, words and their delivery, in this order each.
    told_gravity : m/s^2, what the calibration is told; None: the truth.
    flat_known : the recording says which samples lay flat; otherwise that is to be found.
    lying_deg : how far from level the flat segment lies at most.
    """

    name: str
    wanted: Wanted = HONEST
    motion: Motion = poses
    hand: Hand = _USUAL
    around: tuple[Around, ...] = ()
    chip: Chip = _MPU6050
    sampling: Sampling = _AT_200_HZ
    faults: tuple[Fault, ...] = ()
    digits: tuple[Digits, ...] = ()
    timing: tuple[Timing, ...] = ()
    told_gravity: float | None = None
    flat_known: bool = False
    lying_deg: float = 5.0


@dataclass(frozen=True)
class Simulated:
    """A recording, and the sensor to compare with: in the body frame in which K is symmetric, means where it moved."""

    recording: Recording
    truth: SensorTruth


def simulate(family: Family, seed: int) -> Simulated:
    """Simulate the recording that a seed draws; other families draw other hands and sensors of the same seed."""
    rng = np.random.default_rng([seed, zlib.crc32(family.name.encode())])
    of_sensor, of_motion, of_noise, of_faults, of_digits, of_timing = rng.spawn(6)
    truth = family.chip.draw(of_sensor, GRAVITY_MPS2)
    course = family.motion(family.sampling.step_s, of_motion)
    readings = _measured(family, truth, course, of_motion, of_noise)
    for fault in family.faults:
        readings = fault(readings, of_faults)
    y, clipped = np.hstack((readings.acc, readings.gyr)), np.zeros((len(readings.t), 6), bool)
    if family.chip.bits:
        counts, clipped = family.chip.counts(y)
        for digits in family.digits:
            counts = digits(counts, of_digits)
        y = counts * family.chip.step
    t, rows = np.arange(len(y)) / family.sampling.rate_hz, np.arange(len(y))
    for timing in family.timing:
        t, kept = timing(t, of_timing)
        rows = rows[kept]
    last_flat = int(np.searchsorted(readings.t[rows], 0.95 * readings.turning_share(0.0)))
    recording = Recording.from_arrays(
        t,
        y[rows, :3],
        y[rows, 3:],
        flat=(0, last_flat) if family.flat_known else None,
        temperature_c=readings.temperature_c[rows],
        acc_clipped=clipped[rows, :3].any(axis=1),
        gyr_clipped=clipped[rows, 3:].any(axis=1),
        sensor=_sensor(family),
        name=f"{family.name} {seed}",
    )
    return Simulated(recording, readings.truth.symmetric()[0])


def _measured(family: Family, truth: SensorTruth, course: Course, of_motion: Rng, of_noise: Rng) -> Readings:
    """Return what a sensor reads whose truth is D, b_a, K, b_omega and white noise."""
    sampling, omega = family.sampling, course.omega
    world = np.zeros_like(omega)
    for around in (family.hand.push, *family.around):
        push, rates = around(course, of_motion)
        world, omega = world + push, omega + rates
    lying = np.append(np.radians(family.lying_deg) * of_motion.uniform(-1.0, 1.0, 2), of_motion.uniform(-3.0, 3.0))
    q = attitudes(omega, sampling.step_s, rotation.exp(lying))
    lever = family.hand.lever(course, of_motion)
    force = specific_force(q, omega, sampling.step_s, truth.gravity, lever, world)
    acc = sampling.accelerometer(force @ truth.D.T + truth.b_a, truth.accel_noise_density, of_noise)
    gyr = sampling.gyroscope(omega @ np.linalg.inv(truth.K).T + truth.b_omega, truth.gyro_noise_density, of_noise)
    n, per_sample = len(acc), sampling.per_sample
    middle = slice(per_sample // 2, n * per_sample, per_sample)
    return Readings(
        t=course.t[middle],
        moving=course.moving[middle],
        force=force[middle],
        acc=acc,
        gyr=gyr,
        temperature_c=np.full(n, TEMPERATURE_C),
        truth=truth,
        ranges=family.chip.ranges,
    )


def _sensor(family: Family) -> Sensor:
    """Return what the recording says of its sensor."""
    chip = family.chip
    said = Sensor(chip=chip.name, rate_hz=family.sampling.rate_hz, message=chip.message)
    if not chip.bits:
        return said
    return replace(said, accel_range_g=chip.accel_range_g, gyro_range_dps=chip.gyro_range_dps)
