import math
import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.data import Sensor
from mpucal.session.aims import ALL_AROUND
from mpucal.session.attitude import quaternion, straight
from mpucal.session.events import Ask, Connected, Knowledge, Learnt, Measured, Meter, Prompt, Target, Wish
from mpucal.session.machine import Machine
from mpucal.session.meter import MotionWatch
from mpucal.simulated.hands import KINDS
from mpucal.sources.opening import open_source

STILL = np.zeros(3)
SECONDS = 60.0
# what the gyroscope may have turned besides between two meters: its noise and a drift
BEYOND_DEG = 20.0


def matrix(q):
    return Rotation.from_quat(q, scalar_first=True)


@pytest.mark.parametrize("seed", range(50))
def test_a_quaternion_is_that_of_its_matrix(seed):
    turn = Rotation.random(random_state=seed)
    assert np.allclose(quaternion(turn.as_matrix()), turn.as_quat(canonical=True, scalar_first=True))


def test_a_half_turn_has_a_quaternion():
    assert np.allclose(np.abs(quaternion(np.diag([1.0, -1.0, -1.0]))), [0, 1, 0, 0])


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
    """As `up` says, and however it was turned about the vertical as it came."""
    up = np.array(up) / np.linalg.norm(up)
    assert np.allclose(straight(up) @ up, [0, 0, 1])


def learnt(down):
    wanted = Target(0.1, 0.05, 1.0)
    three = (0.1, 0.1, 0.1)
    return Learnt(Knowledge(0.0, three, three, three, wanted, three, three, three, 0.1, down, ""), down is not None)


def meters(hand, seed):
    """All meters of a simulated minute, which asks for one direction after the other."""
    source = open_source({"bus": f"sim:hand={hand}", "seed": seed})
    asked = iter(np.random.default_rng(seed).permutation(ALL_AROUND).tolist())
    machine, found = Machine(), []

    def tell(event):
        for output in machine.handle(event):
            match output:
                case Meter():
                    found.append(output)
                case Prompt():
                    for listener in source.listeners:
                        listener(output)
                case Ask(wish=Wish.ADVISE):
                    tell(learnt(tuple(next(asked))))
                case Ask(wish=Wish.KNOW):
                    tell(learnt(None))

    with source.measuring(Path(os.devnull), print, "") as measuring:
        tell(Connected(measuring.source.start()))
        while measuring.source.now_ns() < SECONDS * 1e9 and machine.state in MEASURING:
            samples = measuring.source.poll()
            if len(samples):
                tell(Measured(samples))
    return found


MEASURING = ("lay flat", "rotate", "verify")


@pytest.mark.parametrize("hand", KINDS)
def test_the_picture_does_not_jump(hand):
    """From one meter to the next it turns by no more than gravity did, or the gyroscope says."""
    found = meters(hand, 1)
    assert len(found) > 100
    for before, after in pairwise(found):
        turned = np.degrees((matrix(after.attitude) * matrix(before.attitude).inv()).magnitude())
        gravity = np.degrees(np.arccos(np.clip(np.dot(before.down, after.down), -1, 1)))
        own = gravity + 0.25 * max(before.turning_dps, after.turning_dps)
        assert turned <= own + BEYOND_DEG
