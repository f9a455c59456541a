"""Whole recordings with known truth: the paper's simulation and an MPU-6050 by hand.

A motion of the hand gives omega (n, 3) [rad/s] in the body at the times t (n,) [s], and how much it moves then (n,), 0
to 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mpucal.calibration.rotation import cross, shortest_turn
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording, Sensor, Vector
from mpucal.simulated import rotation
from mpucal.simulated.disturbance import HandDisturbance
from mpucal.simulated.sensor import SensorTruth, SiSetting

from .body import acceleration, tremor
from .course import minimum_jerk_rate
from .sensors import GRAVITY_MPS2, hand_sensor, paper_sensor, quantise

FLAT_S, MOVING_S = 10.0, 40.0
CHECK_S = 15.0
APART_RAD = np.radians(25.0)
SLOPPY_RAD = np.radians(8.0)


def plateau(t: Vector, start: float, end: float, ramp: float) -> Vector:
    """Return 1 between start and end [s], 0 outside, with smooth ramps inside that take `ramp` s."""
    rise, fall = (np.clip(x / ramp, 0.0, 1.0) for x in (t - start, end - t))
    shape: Vector = (rise * fall) ** 2 * (3 - 2 * rise) * (3 - 2 * fall)
    return shape


def moves(t: Vector, turns: Vector, durations: Vector, starts: NDArray[np.floating]) -> tuple[Vector, Vector]:
    """Return omega (n, 3) and moving (n,) of separate moves by rotation vectors turns (m, 3) [rad]."""
    omega, moving = np.zeros((len(t), 3)), np.zeros(len(t))
    for turn, duration, start in zip(turns, durations, starts, strict=True):
        omega += minimum_jerk_rate((t - start) / duration)[:, None] / duration * turn
        moving += plateau(t, start, start + duration, ramp=0.2)
    return omega, moving


def poses(t: Vector, rng: np.random.Generator, n: int) -> tuple[Vector, Vector]:
    """Draw n still orientations, the flat one among them, by moves of 50 to 130 deg about x, y, z in turn."""
    m = n - 1
    about = np.eye(3)[np.arange(m) % 3] * rng.choice([-1.0, 1.0], m)[:, None]
    turns = about * np.radians(rng.uniform(50, 130, m))[:, None] + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (m, 3))
    return moves(t, turns, np.full(m, 1.6), FLAT_S + MOVING_S / m * np.arange(m))


def three_orientations(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw three still orientations in 15 s, each 25 deg or more from the others and from flat, as for a check."""
    while True:
        axis = rng.standard_normal((3, 3))
        axis[0, 2] = 0.0  # a turn about the vertical is none
        turns = np.radians(rng.uniform(40, 110, 3))[:, None] * axis / np.linalg.norm(axis, axis=1, keepdims=True)
        board = board_from_world(rotation.running_product(np.array([1.0, 0, 0, 0]), rotation.exp(turns)))
        up = board[..., 2]
        if (up @ up.T - 2.0 * np.eye(4)).max() < np.cos(APART_RAD):
            return moves(t, turns, np.full(3, 1.6), FLAT_S + CHECK_S / 3 * np.arange(3))


def as_asked(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw the three that a check asks for, each missed by some degrees: two edges of a box, and one across both."""
    up = np.array([[0, 0, 1], [1, 1, 0], [-1, 1, 0], [0, -1, -1]]) / np.sqrt([[1], [2], [2], [2]])
    turns = np.array([shortest_turn(after, before) for before, after in pairwise(up)])
    turns += rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (3, 3))
    return moves(t, turns, np.full(3, 1.6), FLAT_S + CHECK_S / 3 * np.arange(3))


def six_faces(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw the six faces of a box, by moves of 90 or 180 deg."""
    turns = np.pi / 2 * np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 2]])
    turns = turns + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, turns.shape)
    return moves(t, turns, np.full(5, 2.0), FLAT_S + MOVING_S / 5 * np.arange(5))


def three_turns(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw a complete turn about each axis, 12 s each, 1 s apart."""
    turns = 2 * np.pi * np.eye(3) + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (3, 3))
    return moves(t, turns, np.full(3, 12.0), FLAT_S + 13.0 * np.arange(3))


def continuous(t: Vector, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Draw six sines an axis at 0.08 to 0.7 Hz, 80 deg/s rms, until the end."""
    frequency, phase = rng.uniform(0.08, 0.7, (6, 3)), rng.uniform(0.0, 2 * np.pi, (6, 3))
    weight = rng.uniform(0.5, 1.0, (6, 3))
    since = np.maximum(t - FLAT_S, 0.0)
    omega = sum(
        w * np.sin(2 * np.pi * f * since[:, None] + p) for w, f, p in zip(weight, frequency, phase, strict=True)
    )
    moving = plateau(t, FLAT_S, np.inf, ramp=1.0)
    omega *= moving[:, None]
    rms: Vector = np.sqrt((omega[t >= FLAT_S] ** 2).mean(0))
    return omega * np.radians(80.0) / rms, moving


def board_from_world(q: Vector) -> Vector:
    """Return R(x) of equation (3), (..., 3, 3), from the world's axes to the board's, of quaternions (..., 4)."""
    V = cross(q[..., 1:])
    return np.asarray(np.eye(3) + 2.0 * (V @ V - q[..., 0, None, None] * V))


def attitude(omega: Vector, step_s: float, start_rad: Vector | None = None) -> Vector:
    """Return R(x_t) of equation (3) before each step of step_s with omega (n, 3), and after the last: (n + 1, 3, 3).

    start_rad : (3,) the turn that took the world's axes to the board's at first; None: none.
    """
    start = rotation.exp(np.zeros(3) if start_rad is None else start_rad)
    return board_from_world(rotation.running_product(start, rotation.exp(step_s * omega)))


TRUTH_HZ = 2000.0
# one count of an MPU-6050 at 2 g and 500 deg/s; the paper's sensors are as fine as float64
STEPS, UNQUANTISED = (2.0 * STANDARD_GRAVITY_MPS2 / 32768, float(np.radians(500.0)) / 32768), (0.0, 0.0)
TREMOR_MPS2, TREMOR_RAD_S = 0.1, float(np.radians(1.0))


@dataclass(frozen=True)
class Simulated:
    """A recording and its truth.

    Attributes
    ----------
    truth : in the body frame in which K is symmetric, as an estimator finds it.
    specific_force : (n, 3) m/s^2, R(x_t) g without the hand's acceleration. attitude : (n, 3, 3), R(x_t).
    """

    recording: Recording
    truth: SensorTruth
    specific_force: Vector
    attitude: Vector


_USUAL = HandDisturbance()
_CALM = HandDisturbance(lever_m=(0.0, 0.0), sway_mps2=0.0, jerks_per_s=3.0)


@dataclass(frozen=True)
class _Scene:
    motion: Callable[[Vector, np.random.Generator], tuple[Vector, Vector]]
    habits: HandDisturbance = _USUAL
    perfect_gyro: bool = False
    moving_s: float = MOVING_S


SCENES = {
    "pose6": _Scene(six_faces),
    "pose7": _Scene(partial(poses, n=7)),
    "pose9": _Scene(partial(poses, n=9)),
    "pose12": _Scene(partial(poses, n=12)),
    "check": _Scene(three_orientations, moving_s=CHECK_S),
    "check as asked": _Scene(as_asked, moving_s=CHECK_S),
    "continuous": _Scene(continuous),
    "wobble30": _Scene(continuous, HandDisturbance(wobble=0.3)),
    "wobble100": _Scene(continuous, HandDisturbance(wobble=1.0)),
    "turns": _Scene(three_turns),
    "calm jerks": _Scene(continuous, _CALM, perfect_gyro=True),
}


def paper_scenario(
    seed: int, *, rate_hz: float = 100.0, turn_s: float = 10.0, sensor: SensorTruth | None = None
) -> Simulated:
    """Simulate the paper's section 4.3: 10 s flat, then one complete turn about each axis, turn_s each.

    sensor : drawn from the seed unless given; one given to many seeds makes section 4.4.
    """
    of_sensor, of_noise = np.random.default_rng(seed).spawn(2)
    sensor = sensor or paper_sensor(of_sensor, rate_hz)
    n_flat, n_turn = round(FLAT_S * rate_hz), round(turn_s * rate_hz)
    omega = np.concatenate([np.zeros((n_flat, 3)), *(np.tile(e, (n_turn, 1)) for e in 2 * np.pi / turn_s * np.eye(3))])
    R = attitude(omega, 1.0 / rate_hz)[:-1]
    s = sensor.gravity * R[..., 2]
    return _measured(f"paper {seed}", sensor, UNQUANTISED, rate_hz, omega, s, R, np.zeros_like(s), of_noise)


def hand_scenario(
    seed: int,
    motion: str,
    *,
    tremble: bool = False,
    delay_s: float = 0.0,
    rate_hz: float = 200.0,
    sensor: SensorTruth | None = None,
    truth_hz: float = TRUTH_HZ,
) -> Simulated:
    """Simulate an MPU-6050 that a hand moves after 10 s flat, for 40 s; for 15 s in the motions of a check.

    Parameters
    ----------
    seed : draws the sensor, the motion, the hand and the noise; each is the same whatever the other arguments.
    motion : one of SCENES. tremble : the hand trembles in the poses.
    delay_s : how much later the accelerometer reports than the gyroscope.
    sensor : drawn from the seed unless given. truth_hz : how finely the hand is simulated, at least.
    """
    scene = SCENES[motion]
    habits = scene.habits
    if tremble:
        habits = replace(habits, tremor_mps2=TREMOR_MPS2, tremor_rad_s=TREMOR_RAD_S)
    of_sensor, of_motion, of_hand, of_tremor, of_noise = np.random.default_rng(seed).spawn(5)
    per_sample = max(round(truth_hz / rate_hz), 1)
    step_s = 1.0 / (rate_hz * per_sample)
    n = round((FLAT_S + scene.moving_s) * rate_hz) * per_sample
    t = step_s * np.arange(0.5, n)
    omega, moving = scene.motion(t, of_motion)
    holding = np.where(t >= FLAT_S, 1.0 - moving, 0.0)
    a = acceleration(habits, omega, moving, holding, step_s, of_hand)
    omega = omega + tremor(habits, holding, step_s, of_tremor)
    tilt = np.append(np.radians(of_motion.uniform(-2.0, 2.0, 2)), 0.0)
    R = attitude(omega, step_s, -tilt)
    s = GRAVITY_MPS2 * 0.5 * (R[:-1, :, 2] + R[1:, :, 2])
    # a DLPF reports the mean over a sample
    omega, s, a = (_means(x, per_sample) for x in (omega, s, _delayed(s + a, t, delay_s) - s))
    R = R[per_sample // 2 :: per_sample][: len(s)]
    sensor = sensor or hand_sensor(of_sensor, scene.perfect_gyro)
    return _measured(f"simulated {motion} {seed}", sensor, STEPS, rate_hz, omega, s, R, a, of_noise)


def _measured(
    name: str,
    sensor: SensorTruth,
    steps: tuple[float, float],
    rate_hz: float,
    omega: Vector,
    s: Vector,
    R: Vector,
    a: Vector,
    rng: np.random.Generator,
) -> Simulated:
    """Return what the sensor reads, in steps [m/s^2, rad/s], of rates omega and specific force s + a, all (n, 3)."""
    normal = np.hstack((rng.standard_normal(s.shape), np.zeros((len(s), 1)), rng.standard_normal(s.shape)))
    y = sensor.response(SiSetting(rate_hz)).values(s + a, omega, normal)
    (acc, acc_clipped), (gyr, gyr_clipped) = quantise(y[:, :3], steps[0]), quantise(y[:, 4:], steps[1])
    truth, Q = sensor.symmetric()
    recording = Recording.from_arrays(
        np.arange(len(s)) / rate_hz,
        acc,
        gyr,
        flat=(0, round(FLAT_S * rate_hz)),
        acc_clipped=acc_clipped,
        gyr_clipped=gyr_clipped,
        sensor=Sensor(rate_hz=rate_hz),
        name=name,
    )
    return Simulated(recording, truth, s @ Q.T, Q @ R)


def _means(x: Vector, size: int) -> Vector:
    """Return means of consecutive size rows of x (n, 3)."""
    means: Vector = x.reshape(-1, size, 3).mean(1)
    return means


def _delayed(x: Vector, t: Vector, delay_s: float) -> Vector:
    """Return x (n, 3) of the times t as it was delay_s before."""
    if delay_s == 0.0:
        return x
    return np.stack([np.interp(t - delay_s, t, column) for column in x.T], axis=1)
