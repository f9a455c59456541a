"""Motion of a simulated hand: means over samples, and the behaviour of each kind of hand."""

from functools import reduce
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.calibration.rotation import shortest_turns
from mpucal.simulated import rotation
from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS
from mpucal.simulated.motion import Motion

GRAVITY = 9.81
PERIOD_S = 1 / (200 * 1.00371)
POLL = 50


def prompt(kind, down=None):
    return SimpleNamespace(kind=kind, down=down)


def matrix(q):
    """Return SciPy's rotation matrix of a quaternion (w, x, y, z)."""
    return Rotation.from_quat([*q[1:], q[0]]).as_matrix()


def product(rates):
    """Return the product of every sample's turn, as SciPy's matrices."""
    return reduce(np.matmul, Rotation.from_rotvec(rates * PERIOD_S).as_matrix())


@pytest.mark.parametrize("kind", ["guided", "random"])
def test_the_rates_integrate_to_the_attitude(kind):
    """Lay the board flat and turn it, and add up every sample's turn."""
    hand, motion = np.random.default_rng(3).spawn(2)
    moved = Motion(HANDS[kind](hand), motion, GRAVITY)
    R = matrix(moved.attitude(0.0))
    for first in range(0, int(20.0 / PERIOD_S), POLL):
        # a repeated prompt is ignored
        moved.hear(prompt("lay_flat" if first * PERIOD_S < 12.0 else "rotate"), first * PERIOD_S)
        edges = np.arange(first, first + POLL + 1) * PERIOD_S
        R = R @ product(moved.means(edges)[1])
    error = R.T @ matrix(moved.attitude(float(edges[-1])))
    assert np.degrees(np.arccos(min(1.0, (np.trace(error) - 1) / 2))) < 0.02


def test_an_arm_sways_and_trembles_as_much_as_it_says():
    """Slow turns in a pose move gravity, and the rates hold the tremor of 8 to 12 Hz."""
    arm = ARMS["raised"]
    hand, motion = np.random.default_rng(4).spawn(2)
    held = Motion(HANDS["still"](hand), motion, GRAVITY, disturbance=arm)
    held.hear(prompt("hold_still"), 0.0)
    force, rate = held.means(np.arange(12000) * PERIOD_S)
    still = slice(600, None)
    slowly = force[still][: 11200 // 40 * 40].reshape(-1, 40, 3).mean(1)
    tilt = (slowly - slowly.mean(0))[:, :2] / GRAVITY
    assert arm.held_rad < np.sqrt((tilt**2).mean()) < 1.2 * (arm.held_rad + arm.held_m / GRAVITY * (2 * np.pi) ** 2)
    spectrum = np.abs(np.fft.rfft(rate[still], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(rate[still]), PERIOD_S)
    fast = frequency > 5.0
    band = (frequency > 7.9) & (frequency < 12.1)
    assert spectrum[band].sum() > 0.98 * spectrum[fast].sum()
    of_band = np.sqrt(2.0 * spectrum[band].sum() / 3.0) / len(rate[still])
    assert of_band == pytest.approx(arm.tremor_rad_s, rel=0.1)


@pytest.mark.parametrize(
    ("a", "b"),
    [([0, 0, 1], [0, 0, 1]), ([0, 0, 1], [0, 0, -1]), ([1, 0, 0], [-1, 0, 0]), ([1, 0, 0], [0, 0.6, 0.8])],
    ids=["the same", "opposite", "opposite x", "across"],
)
def test_the_shortest_turn(a, b):
    a, b = np.array([a, b], float)
    (turn,) = shortest_turns(a[None], b[None])
    np.testing.assert_allclose(matrix(rotation.exp(turn)) @ a, b, atol=1e-9)
    assert np.linalg.norm(turn) == pytest.approx(np.arccos(a @ b), abs=1e-7)


@pytest.mark.parametrize("late_s", [0.001, -0.001])
def test_force_or_rate_may_lag_behind_the_other(late_s):
    edges = np.arange(400) * PERIOD_S
    said = [prompt("rotate")]

    def means(at, *late):
        hand, motion = np.random.default_rng(3).spawn(2)
        moved = Motion(HANDS["random"](hand), motion, GRAVITY)
        moved.hear(said[0], 0.0)
        return moved.means(at, *late)

    force, rate = means(edges, late_s)
    on_time, earlier = means(edges), means(edges[1:] - 0.001)
    late, punctual = (0, 1) if late_s > 0 else (1, 0)
    np.testing.assert_allclose((force, rate)[late][1:], earlier[late], atol=1e-9)
    np.testing.assert_array_equal((force, rate)[punctual], on_time[punctual])
    assert np.abs(earlier[late] - on_time[late][1:]).max() > 1e-3
