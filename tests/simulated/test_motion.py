"""Motion of a simulated hand: means over samples, and the behaviour of each kind of hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.simulated.disturbance import ARMS
from mpucal.simulated.hands import HANDS
from mpucal.simulated.motion import AHEAD_S, Motion

GRAVITY = 9.81
PERIOD_S = 1 / (200 * 1.00371)


def prompt(kind, down=None):
    return SimpleNamespace(kind=kind, down=down)


class Run:
    """Session with a hand: prompts (s, prompt) at their times, and means over every sample."""

    def __init__(self, kind, prompts, seconds, seed=3, poll=50):
        hand, motion = np.random.default_rng(seed).spawn(2)
        self.motion = Motion(HANDS[kind](hand), motion, GRAVITY)
        self.first_attitude = self.motion.attitude(0.0)
        forces, rates, waiting = [], [], list(prompts)
        for i in range(0, int(seconds / PERIOD_S), poll):
            while waiting and waiting[0][0] <= i * PERIOD_S:
                self.motion.hear(waiting.pop(0)[1], i * PERIOD_S)
            force, rate = self.motion.means(np.arange(i, i + poll + 1) * PERIOD_S)
            forces.append(force)
            rates.append(rate)
        self.force, self.rate = np.concatenate(forces), np.concatenate(rates)
        self.end_s = len(self.force) * PERIOD_S

    def part(self, array, first_s, last_s):
        return array[int(first_s / PERIOD_S) : int(last_s / PERIOD_S)]

    def pauses(self):
        """Return the mean specific force of every second in which the board did not turn."""
        n = int(1 / PERIOD_S)
        seconds = [slice(i, i + n) for i in range(0, len(self.rate) - n, n // 4)]
        return np.array([self.force[s].mean(0) for s in seconds if np.abs(self.rate[s]).max() < 0.1])


def matrix(q):
    """Return SciPy's rotation matrix of a quaternion (w, x, y, z)."""
    return Rotation.from_quat([*q[1:], q[0]]).as_matrix()


def product(rates):
    """Return the product of every sample's turn, as SciPy's matrices, neighbours first."""
    turns = Rotation.from_rotvec(rates * PERIOD_S).as_matrix()
    while len(turns) > 1:
        left = turns[len(turns) // 2 * 2 :]
        turns = np.concatenate((turns[: len(turns) // 2 * 2 : 2] @ turns[1::2], left))
    return turns[0]


SESSION = ((0.0, prompt("lay_flat")), (12.0, prompt("rotate")))


@pytest.mark.parametrize("kind", ["guided", "random", "restless"])
def test_the_rates_integrate_to_the_attitude(kind):
    run = Run(kind, SESSION, 30.0)
    R = matrix(run.first_attitude) @ product(run.rate)
    error = R.T @ matrix(run.motion.attitude(run.end_s))
    assert np.degrees(np.arccos(min(1.0, (np.trace(error) - 1) / 2))) < 0.02


def test_the_motion_does_not_depend_on_how_it_is_asked():
    run, other = Run("guided", SESSION[:1], 10.0), Run("guided", SESSION[:1], 10.0, poll=1)
    n = min(len(run.force), len(other.force))
    np.testing.assert_allclose(other.force[:n], run.force[:n], atol=1e-9)
    np.testing.assert_allclose(other.rate[:n], run.rate[:n], atol=1e-9)


def test_it_reacts_no_sooner_than_a_person_and_no_later():
    assert AHEAD_S < 0.5
    for seed in range(4):
        run = Run("guided", ((4.0, prompt("lay_flat")), (12.0, prompt("rotate"))), 14.5, seed=seed)
        flat = np.abs(run.rate).max(axis=1) < 1e-9
        assert not run.part(flat, 0.0, 4.5).any()
        assert run.part(flat, 11.0, 12.4).all()
        assert not run.part(flat, 13.7, 14.5).any()


def test_lay_flat_leaves_the_board_flat_and_perfectly_still():
    run = Run("guided", SESSION[:1], 12.0)
    np.testing.assert_allclose(run.part(run.force, 5.0, 12.0), [[0, 0, GRAVITY]] * 1405, atol=1e-9)
    assert np.abs(run.part(run.rate, 5.0, 12.0)).max() < 1e-12


def test_hold_still_does_not_interrupt_laying_flat():
    run = Run("guided", ((0.0, prompt("lay_flat")), (0.1, prompt("hold_still"))), 8.0)
    np.testing.assert_allclose(run.force[-1], [0, 0, GRAVITY], atol=1e-9)


def test_rest_puts_the_board_down():
    run = Run("guided", (*SESSION, (25.0, prompt("rest"))), 35.0)
    assert np.abs(run.part(run.rate, 31.0, 35.0)).max() < 1e-12


@pytest.mark.parametrize(("kind", "n"), [("rotate", None), ("sing", 3000)], ids=["the same", "unknown"])
def test_a_repeated_or_unknown_prompt_changes_nothing(kind, n):
    plain, prompted = Run("guided", SESSION, 30.0), Run("guided", (*SESSION, (17.0, prompt(kind))), 30.0)
    np.testing.assert_array_equal(prompted.force[:n], plain.force[:n])


def test_in_the_hand_still_is_not_still():
    trembles = []
    for seed in range(6):
        run = Run("still", (), 10.0, seed=seed)
        up = run.force.mean(axis=0)
        trembles.append((run.force - up).std(axis=0).mean())
        assert 2.0 < np.degrees(np.sqrt((run.rate**2).sum(axis=1).mean())) < 3.0
    # a seated person's tremor of 0.08 to 0.16 m/s^2, and some tilting
    assert 0.07 < min(trembles) < max(trembles) < 0.2


def test_asked_for_a_direction_it_misses_by_less_than_8_degrees():
    misses = []
    for seed in range(8):
        down = np.array([0.6, 0.0, 0.8]) if seed % 2 else np.array([-1.0, 0.0, 0.0])
        run = Run("guided", ((0.0, prompt("lay_flat")), (6.0, prompt("rotate", tuple(down)))), 10.5, seed=seed)
        force = run.part(run.force, 9.4, 9.9).mean(axis=0)
        misses.append(np.degrees(np.arccos(-force @ down / np.linalg.norm(force))))
    assert np.median(misses) > 3.0
    assert max(misses) < 9.0


def test_turning_it_shows_different_orientations_with_pauses():
    run = Run("guided", SESSION, 62.0)
    poses = run.pauses() / np.linalg.norm(run.pauses(), axis=1, keepdims=True)
    distinct = []
    for pose in poses:
        if all(pose @ other < np.cos(np.radians(25)) for other in distinct):
            distinct.append(pose)
    assert len(distinct) >= 12
    tilted = [pose for pose in distinct if np.sort(np.abs(pose))[1] > 0.4]
    assert len(tilted) >= 5
    assert np.abs(np.linalg.norm(run.pauses(), axis=1) - GRAVITY).max() < 0.2


def poses_of(run, first_s, last_s):
    """Return the direction of gravity (k, 3) in each pause between two times, in order."""
    still = np.abs(run.part(run.rate, first_s, last_s)).max(axis=1) < 0.1
    force = run.part(run.force, first_s, last_s)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], still.astype(int), [0]))))
    held = [force[a:b].mean(axis=0) for a, b in edges.reshape(-1, 2) if b - a > 1.0 / PERIOD_S]
    return np.array(held) / np.linalg.norm(held, axis=1, keepdims=True)


def test_the_repeating_hand_verifies_by_poses_of_the_turning_and_two_of_them_twice():
    asked = prompt("verify", (0.6, 0.0, 0.8))
    # it misses by up to 8 deg each time
    seen = np.cos(np.radians(16.5))
    for seed in range(2):
        run = Run("repeating", (*SESSION, (45.0, asked)), 64.0, seed=seed)
        turned, verified = poses_of(run, 14.0, 45.0), poses_of(run, 48.0, 64.0)
        assert len(verified) >= 4
        assert (verified @ turned.T).max(axis=1).min() > seen
        first, second, again, once_more = verified[:4]
        assert first @ again > seen and second @ once_more > seen
        assert first @ second < seen


def test_the_still_hand_does_not_turn_and_the_restless_hand_never_lies_still():
    run = Run("still", SESSION, 30.0)
    assert np.abs(run.part(run.rate, 5.0, 30.0)).max() < 1e-12
    run = Run("restless", SESSION[:1], 30.0)
    for i in range(0, len(run.rate) - 200, 100):
        assert run.rate[i : i + 200].std(axis=0).max() > 0.03


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


@pytest.mark.parametrize("late_s", [0.001, -0.001])
def test_one_of_the_two_may_be_that_of_earlier(late_s):
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
