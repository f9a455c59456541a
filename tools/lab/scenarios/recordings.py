"""Scenes of a hand that follows the guidance, and the paper's simulation, with known truth: rows over one engine.

A motion gives the board's turns on a clock of steps, as in course.py.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from mpucal.calibration.rotation import shortest_turns
from mpucal.data import Recording, Sensor, Vector
from mpucal.rests.flat import Flat, flat_statistics
from mpucal.simulated import rotation
from mpucal.simulated.disturbance import JERK_S
from mpucal.simulated.sensor import SensorTruth

from .around import Hand
from .body import attitudes, board_from_world
from .course import FLAT_S, Course, Leg, Motion, Rng, along, begun
from .family import Family, Simulated, simulate
from .sensors import BY_HAND, Chip, Sampling, paper_sensor

MOVING_S, CHECK_S = 40.0, 15.0
APART_RAD = np.radians(25.0)
SLOPPY_RAD = np.radians(8.0)
TREMOR_MPS2, TREMOR_RAD_S = 0.1, float(np.radians(1.0))
HAND = Hand((0.15, 0.3), jerk_s=JERK_S)


def evenly(turns: Vector, move_s: float, step_s: float, whole_s: float = MOVING_S) -> Course:
    """Return separate moves of move_s by rotation vectors turns (m, 3) [rad], evenly within whole_s."""
    return along([Leg(turn, move_s, whole_s / len(turns) - move_s) for turn in turns], step_s)


def poses(step_s: float, rng: Rng, n: int, whole_s: float = MOVING_S) -> Course:
    """Draw n still orientations in whole_s, the flat one too, by moves of 50 to 130 deg about x, y, z in turn."""
    m = n - 1
    about = np.eye(3)[np.arange(m) % 3] * rng.choice([-1.0, 1.0], m)[:, None]
    turns = about * np.radians(rng.uniform(50, 130, m))[:, None] + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (m, 3))
    return evenly(turns, 1.6, step_s, whole_s)


def three_orientations(step_s: float, rng: Rng) -> Course:
    """Draw three still orientations in 15 s, each 25 deg or more from the others and from flat, as for a check."""
    while True:
        axis = rng.standard_normal((3, 3))
        axis[0, 2] = 0.0  # a turn about the vertical is none
        turns = np.radians(rng.uniform(40, 110, 3))[:, None] * axis / np.linalg.norm(axis, axis=1, keepdims=True)
        up = rotation.up_in_board(attitudes(turns, 1.0))
        if (up @ up.T - 2.0 * np.eye(4)).max() < np.cos(APART_RAD):
            return evenly(turns, 1.6, step_s, CHECK_S)


def as_asked(step_s: float, rng: Rng) -> Course:
    """Draw the three that a check asks for, each missed by some degrees: two edges of a box, and one across both."""
    up = np.array([[0, 0, 1], [1, 1, 0], [-1, 1, 0], [0, -1, -1]]) / np.sqrt([[1], [2], [2], [2]])
    turns = shortest_turns(up[1:], up[:-1])
    return evenly(turns + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (3, 3)), 1.6, step_s, CHECK_S)


def six_faces(step_s: float, rng: Rng) -> Course:
    """Draw the six faces of a box, by moves of 90 or 180 deg."""
    turns = np.pi / 2 * np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 2]])
    return evenly(turns + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, turns.shape), 2.0, step_s)


def three_turns(step_s: float, rng: Rng) -> Course:
    """Draw a complete turn about each axis, 12 s each."""
    return evenly(2 * np.pi * np.eye(3) + rng.uniform(-SLOPPY_RAD, SLOPPY_RAD, (3, 3)), 12.0, step_s)


def sines(step_s: float, rng: Rng) -> Course:
    """Draw six sines an axis at 0.08 to 0.7 Hz, 80 deg/s rms, until the end."""
    frequency, phase = rng.uniform(0.08, 0.7, (6, 3)), rng.uniform(0.0, 2 * np.pi, (6, 3))
    weight, t = rng.uniform(0.5, 1.0, (6, 3)), step_s * np.arange(0.5, round((FLAT_S + MOVING_S) / step_s))
    since, moving = np.maximum(t - FLAT_S, 0.0)[:, None], begun(t)
    each = zip(weight, frequency, phase, strict=True)
    omega = moving[:, None] * sum(w * np.sin(2 * np.pi * f * since + p) for w, f, p in each)
    rms = np.sqrt((omega[t >= FLAT_S] ** 2).mean(0))
    return Course(step_s, omega * np.radians(80.0) / rms, moving)


def _scene(motion: Motion, hand: Hand = HAND, chip: Chip = BY_HAND) -> Family:
    return Family("", motion=motion, hand=hand, chip=chip, flat_known=True, lying_deg=2.0, temperature_c=math.nan)


SCENES = {
    "pose6": _scene(six_faces),
    "pose7": _scene(partial(poses, n=7)),
    "pose8 slow": _scene(partial(poses, n=8, whole_s=70.0)),
    "pose9": _scene(partial(poses, n=9)),
    "pose12": _scene(partial(poses, n=12)),
    "check": _scene(three_orientations),
    "check as asked": _scene(as_asked),
    "continuous": _scene(sines),
    "wobble30": _scene(sines, replace(HAND, wobble=0.3)),
    "wobble100": _scene(sines, replace(HAND, wobble=1.0)),
    "turns": _scene(three_turns),
    # its gyroscope is perfect
    "calm jerks": _scene(
        sines,
        replace(HAND, lever_m=(0.0, 0.0), sway_mps2=0.0, jerks_per_s=3.0),
        replace(BY_HAND, gyro_gain=0.0, gyro_cross=0.0),
    ),
}


def known_flat(recording: Recording) -> Flat:
    """Return the statistics of the segment that a simulated recording is known to lie flat in."""
    assert recording.flat is not None
    return flat_statistics(recording, recording.flat)


def hand_scenario(
    seed: int,
    motion: str,
    *,
    tremble: bool = False,
    delay_s: float = 0.0,
    rate_hz: float = 200.0,
    sensor: SensorTruth | None = None,
    truth_hz: float = 2000.0,
) -> Simulated:
    """Simulate an MPU-6050 that a hand moves after 10 s flat, for 40 s; for 15 s in the motions of a check.

    Parameters
    ----------
    seed : draws the sensor, the motion, the hand and the noise; each is the same whatever the other arguments.
    motion : one of SCENES. tremble : the hand trembles in the poses.
    delay_s : how much later the accelerometer reports than the gyroscope.
    sensor : drawn from the seed unless given. truth_hz : how finely the hand is simulated, at least.
    """
    scene, sampling = SCENES[motion], Sampling(rate_hz, delay_ms=1e3 * delay_s, fine_hz=truth_hz)
    hand = replace(scene.hand, tremor_mps2=TREMOR_MPS2, tremor_rad_s=TREMOR_RAD_S) if tremble else scene.hand
    scene = replace(scene, sampling=sampling, hand=hand)
    made = simulate(scene, np.random.default_rng(seed), sensor)
    told = Sensor(rate_hz=rate_hz)
    return replace(made, recording=replace(made.recording, sensor=told, name=f"simulated {motion} {seed}"))


def paper_scenario(
    seed: int, *, rate_hz: float = 100.0, turn_s: float = 10.0, turns: int = 3, sensor: SensorTruth | None = None
) -> Simulated:
    """Simulate the paper's section 4.3: 10 s flat, then complete turns about x, y, z and so on, turn_s each.

    sensor : drawn from the seed unless given; one given to many seeds makes section 4.4.
    """
    of_sensor, of_noise = np.random.default_rng(seed).spawn(2)
    sensor, sampling = sensor or paper_sensor(of_sensor, rate_hz), Sampling(rate_hz, fine_hz=rate_hz)
    n_flat, n_turn = round(FLAT_S * rate_hz), round(turn_s * rate_hz)
    about = 2 * np.pi / turn_s * np.eye(3)[np.arange(turns) % 3]
    omega = np.concatenate([np.zeros((n_flat, 3)), np.repeat(about, n_turn, axis=0)])
    R = board_from_world(attitudes(omega, 1.0 / rate_hz)[:-1])
    s, (truth, Q) = sensor.gravity * R[..., 2], sensor.symmetric()
    samples = np.arange(len(s)) / rate_hz, *sampling.measured(sensor, s, omega, of_noise)
    recording = Recording.from_arrays(*samples, flat=(0, n_flat), sensor=Sensor(rate_hz=rate_hz), name=f"paper {seed}")
    return Simulated(recording, truth, s @ Q.T, Q @ R)
