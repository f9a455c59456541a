import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.data import STANDARD_GRAVITY_MPS2, Samples, Sensor
from mpucal.session.aims import ALL_AROUND
from mpucal.session.attitude import compose, from_vector, rotate, straight
from mpucal.session.events import Connected, FitKind, Knowledge, Learnt, Measured, Meter, Prompt, RequestFit, Target
from mpucal.session.machine import Machine
from mpucal.session.meter import MotionWatch
from mpucal.simulated.hands import HANDS
from mpucal.simulated.motion import Motion
from mpucal.simulated.sensor import FULL_SCALE, SensorTruth, Setting

# Length of a simulated session, within which the hands' mishaps happen; a poll is 50 ms long.
SECONDS, RATE_HZ, POLL = 40.0, 100.0, 5
GYRO_RANGE_DPS = 500.0
# Allowance for the gyroscope's noise and drift between two meters.
BEYOND_DEG = 20.0


def matrix(q):
    return Rotation.from_quat(q, scalar_first=True)


def test_rotations_are_those_of_scipy():
    one, other = Rotation.random(2, random_state=0)
    p, q = (turn.as_quat(scalar_first=True).tolist() for turn in (one, other))
    assert np.allclose(rotate(p, (0.1, -0.7, 0.4)), one.apply((0.1, -0.7, 0.4)))
    assert np.allclose(rotate(compose(p, q), (0.1, -0.7, 0.4)), (one * other).apply((0.1, -0.7, 0.4)))
    assert np.allclose(from_vector(*one.as_rotvec()), one.as_quat(canonical=True, scalar_first=True))


def test_the_gyroscope_carries_the_heading(board):
    """Once about the vertical by 90 deg, which gravity does not show."""
    watch = MotionWatch(Sensor())
    for _ in range(120):
        watch.add(board.still(0.1))
    watch.flat()
    watch.add(board.turn((0, 0, 1), math.radians(90.0), 2.0))
    (*_, last) = [m for m in watch.add(board.still(2.0)) if isinstance(m, Meter)]
    assert np.degrees((matrix(last.attitude) * Rotation.from_euler("z", -90, degrees=True)).magnitude()) < 3.0


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -1), (0.1, 0.2, -0.97)])
def test_a_board_is_laid_down_straight(up):
    """The direction `up` points up, however the board was turned about the vertical."""
    up = np.array(up) / np.linalg.norm(up)
    assert np.allclose(matrix(straight(up.tolist())).apply(up), [0, 0, 1])


def learnt(down):
    wanted = Target(0.1, 0.05, 1.0)
    three = (0.1, 0.1, 0.1)
    return Learnt(Knowledge(0.0, three, three, three, wanted, three, three, three, 0.1, down, ""), down is not None)


def polls(motion, rng):
    """The samples of a sensor that is moved so, a poll after the other."""
    setting = Setting(RATE_HZ, 4.0, GYRO_RANGE_DPS, lsb_per_c=340.0, zero_c=36.53)
    response, no = SensorTruth.draw(1).response(setting), np.zeros(POLL, bool)
    for first in range(0, round(SECONDS * RATE_HZ), POLL):
        edges_s = np.arange(first, first + POLL + 1) / RATE_HZ
        counts = response.counts(*motion.means(edges_s), rng).astype(float)
        acc, gyr = counts[:, :3] * setting.mps2_per_lsb, counts[:, 4:] * setting.rad_s_per_lsb
        clipped = (np.abs(counts[:, 4:] + 0.5) > FULL_SCALE - 1).any(axis=1)
        yield Samples(edges_s[1:], acc, gyr, np.full(POLL, 25.0), no, no, clipped)


def meters(hand):
    """Return all meters of a simulated hand that is asked for one direction after the other."""
    of_hand, of_motion, of_noise, of_advice = np.random.default_rng(1).spawn(4)
    motion = Motion(HANDS[hand](of_hand), of_motion, STANDARD_GRAVITY_MPS2)
    asked = iter(of_advice.permutation(ALL_AROUND).tolist())
    machine, found, t_s = Machine(), [], 0.0

    def tell(event):
        for output in machine.handle(event):
            match output:
                case Meter():
                    found.append(output)
                case Prompt():
                    motion.hear(output, t_s)
                case RequestFit(kind=FitKind.ADVISE):
                    tell(learnt(tuple(next(asked))))
                case RequestFit(kind=FitKind.KNOW):
                    tell(learnt(None))

    tell(Connected(Sensor(gyro_range_dps=GYRO_RANGE_DPS)))
    for samples in polls(motion, of_noise):
        if machine.state in MEASURING:
            t_s = float(samples.t[-1])
            tell(Measured(samples))
    return found


MEASURING = ("lay flat", "rotate", "verify")


@pytest.mark.parametrize("hand", ["knocking", "hasty"])
def test_the_picture_does_not_jump(hand):
    """The picture turns from one meter to the next by no more than gravity did, or the gyroscope says."""
    found = meters(hand)
    assert len(found) > 100
    for before, after in pairwise(found):
        turned = np.degrees((matrix(after.attitude) * matrix(before.attitude).inv()).magnitude())
        gravity = np.degrees(np.arccos(np.clip(np.dot(before.down, after.down), -1, 1)))
        own = gravity + 0.25 * max(before.turning_dps, after.turning_dps)
        assert turned <= own + BEYOND_DEG
