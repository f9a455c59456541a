from itertools import pairwise

import numpy as np
import pytest

from mpucal.calibration.rotation import rotation
from tools.lab.scenarios.course import minimum_jerk_rate
from tools.lab.scenarios.recordings import (
    FLAT_S,
    attitude,
    continuous,
    poses,
    six_faces,
    three_turns,
)

STEP_S = 1 / 500
T = STEP_S * np.arange(0.5, 25000)


def test_a_move_goes_all_the_way_and_ends_at_rest():
    t = np.linspace(-1, 3, 40001)
    rate = minimum_jerk_rate(t / 1.6) / 1.6
    assert np.trapezoid(rate, t) == pytest.approx(1.0, abs=1e-6)
    assert (rate[(t <= 0) | (t >= 1.6)] == 0).all()


@pytest.mark.parametrize(
    "motion",
    [six_faces, three_turns, continuous, lambda t, rng: poses(t, rng, 12)],
    ids=["faces", "turns", "on", "poses"],
)
def test_every_motion_begins_flat_and_turns_only_while_it_moves(motion):
    omega, moving = motion(T, np.random.default_rng(0))
    assert (omega[T < FLAT_S] == 0).all()
    assert ((moving >= 0) & (moving <= 1)).all()
    assert (np.linalg.norm(omega[moving == 0], axis=1) == 0).all()


@pytest.mark.parametrize("n", [7, 9, 12])
def test_poses_are_that_many_different_orientations(n):
    omega, moving = poses(T, np.random.default_rng(n), n)
    up = attitude(omega, STEP_S)[:-1, :, 2]
    still = np.flatnonzero(moving == 0)
    groups = np.split(still, np.flatnonzero(np.diff(still) > 1) + 1)
    assert len(groups) == n
    for before, after in pairwise(groups):
        assert np.ptp(up[after], axis=0).max() < 1e-9
        assert len(after) * STEP_S > 1.5
        assert not np.allclose(up[before[-1]], up[after[-1]], atol=0.01)


def test_six_faces_are_all_six():
    omega, moving = six_faces(T, np.random.default_rng(2))
    up = attitude(omega, STEP_S)[:-1, :, 2][moving == 0]
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    assert (np.degrees(np.arccos(np.clip(up @ faces.T, -1, 1))).min(axis=0) < 25).all()


def test_continuous_turns_at_eighty_degrees_a_second():
    omega, _ = continuous(T, np.random.default_rng(3))
    np.testing.assert_allclose(np.degrees(np.sqrt((omega[T >= FLAT_S] ** 2).mean(0))), 80.0, rtol=1e-6)


def test_attitude_of_a_constant_rate_is_its_exponential():
    omega = np.tile([0.3, -0.2, 0.9], (1000, 1))
    R = attitude(omega, 0.01)
    np.testing.assert_allclose(R[1000], rotation(-10 * omega[0]), atol=1e-12)
