"""A family of hands and sensors, and the recording with known truth that a seed draws of it."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from mpucal.data import Recording, Sensor, Vector
from mpucal.simulated import rotation
from mpucal.simulated.sensor import SensorTruth

from .around import Around, Hand
from .body import attitudes, board_from_world, lever_acceleration, specific_force
from .course import FLAT_S, Motion, Rng, poses
from .faults import Digits, Fault, Readings, Timing
from .sensors import Chip, Sampling


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
    faults, digits, timing : faults of values, of words and of their delivery, each in this order.
    told_gravity : m/s^2, what the calibration is told; None: the truth.
    flat_known : the recording says which samples lay flat; otherwise that is to be found.
    lying_deg : how far from level the flat segment lies at most. temperature_c : that it records at first.
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
    temperature_c: float = 25.0


@dataclass(frozen=True)
class Simulated:
    """A recording and its truth.

    Attributes
    ----------
    truth : in the body frame in which K is symmetric, as an estimator finds it; of a sensor that changed, the mean.
    specific_force : (n, 3) m/s^2, R(x_t) g without the hand's acceleration. attitude : (n, 3, 3), R(x_t).
    slipped : the truth before and after the mount slipped, in that frame.
    """

    recording: Recording
    truth: SensorTruth
    specific_force: Vector
    attitude: Vector
    slipped: tuple[SensorTruth, ...] = ()


def drawn(family: Family, seed: int) -> Simulated:
    """Simulate the recording that a seed draws; other families draw other hands and sensors of the same seed."""
    return simulate(family, np.random.default_rng([seed, zlib.crc32(family.name.encode())]))


def simulate(family: Family, rng: Rng, truth: SensorTruth | None = None) -> Simulated:
    """Simulate the recording of a sensor, drawn unless given.

    The sensor, the motion, the hand, its tremor and the noise of one generator are the same whatever the others are.
    """
    of_sensor, of_motion, of_hand, of_tremor, of_noise, *of_damage = rng.spawn(8)
    sampling, hand, truth = family.sampling, family.hand, truth or family.chip.draw(of_sensor)
    step_s, per_sample = sampling.step_s, sampling.per_sample
    course = family.motion(step_s, of_motion)
    omega, world = course.omega, np.zeros_like(course.omega)
    for around in family.around:
        push, rates = around(course, of_motion)
        world, omega = world + push, omega + rates
    tilt = np.append(np.radians(family.lying_deg) * of_motion.uniform(-1.0, 1.0, 2), 0.0)
    heading = np.array([0.0, 0.0, of_motion.uniform(-3.0, 3.0)])
    # what the tremor's rates do on the lever is part of its acceleration
    shaken = lever_acceleration(omega, hand.lever(course, of_hand), step_s) + hand.acceleration(course, of_hand)
    omega = omega + hand.tremor(course, of_tremor)
    q = attitudes(omega, step_s, rotation.product(rotation.exp(heading), rotation.exp(-tilt)))
    force = specific_force(q, truth.gravity, world) + shaken
    acc, gyr = sampling.measured(truth, force, omega, of_noise)
    middle = slice(per_sample // 2, len(acc) * per_sample, per_sample)
    moved = course.t[middle], course.moving[middle], force[middle]
    temperature_c = np.full(len(acc), family.temperature_c)
    readings = Readings(*moved, acc, gyr, temperature_c, truth, family.chip.ranges)
    recording, rows, readings = _delivered(family, readings, of_damage)
    truth, Q = readings.truth.symmetric()
    R = board_from_world(q[middle])
    slipped = tuple(each.symmetric()[0] for each in readings.slipped)
    return Simulated(recording, truth, truth.gravity * (R[..., 2] @ Q.T)[rows], (Q @ R)[rows], slipped)


def _delivered(family: Family, readings: Readings, rngs: Sequence[Rng]) -> tuple[Recording, NDArray[np.intp], Readings]:
    """Return the recording of readings after all faults, which of them it holds, and these readings."""
    of_faults, of_digits, of_timing = rngs
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
    recording = Recording.from_arrays(
        t,
        y[rows, :3],
        y[rows, 3:],
        flat=(0, int(np.searchsorted(readings.t[rows], FLAT_S))) if family.flat_known else None,
        temperature_c=readings.temperature_c[rows],
        acc_clipped=clipped[rows, :3].any(axis=1),
        gyr_clipped=clipped[rows, 3:].any(axis=1),
        sensor=_sensor(family),
        name=family.name,
    )
    return recording, rows, readings


def _sensor(family: Family) -> Sensor:
    """Return what the recording says of its sensor."""
    chip = family.chip
    said = Sensor(chip=chip.name, rate_hz=family.sampling.rate_hz, message=chip.message)
    if not chip.bits:
        return said
    return replace(said, accel_range_g=chip.accel_range_g, gyro_range_dps=chip.gyro_range_dps)
