import numpy as np
import pytest

from mpucal.calibration.rotation import rotation
from mpucal.data import Recording
from tools.lab import rivals

GRAVITY, RATE_HZ, HOLD, MOVE = 9.81, 100, 200, 100
B_A, B_OMEGA = np.array([0.3, -0.2, 0.1]), np.array([0.01, -0.02, 0.03])
SIX_FACES = np.pi / 2 * np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 2]])
TWELVE_POSES = np.random.default_rng(3).uniform(-1.5, 1.5, (11, 3))


def posed(turns, D=None):
    """Rests with moves by rotation vectors between them, each at a constant rate, and no noise at all."""
    rates = [np.zeros((5 * HOLD, 3))]
    for turn in turns:
        rates += [np.tile(turn * RATE_HZ / MOVE, (MOVE, 1)), np.zeros((HOLD, 3))]
    omega = np.concatenate(rates)
    s, step = [np.array([0.0, 0.0, GRAVITY])], rotation(-omega / RATE_HZ)
    for F in step[:-1]:
        s.append(F @ s[-1])
    acc = np.array(s) @ (np.eye(3) if D is None else D).T + B_A
    gyr = omega + B_OMEGA
    # a variance of exactly zero is nobody's sensor
    wiggle = 1e-6 * np.random.default_rng(0).standard_normal(acc.shape)
    return Recording.from_arrays(np.arange(len(acc)) / RATE_HZ, acc + wiggle, gyr + wiggle, flat=(0, 4 * HOLD))


def test_turned_to_the_gyro_the_ellipsoid_gives_all_of_d():
    D = (np.eye(3) + np.array([[0.02, 0.01, 0.0], [-0.03, -0.02, 0.02], [0.01, 0.0, 0.03]])) @ rotation(
        np.array([0.03, -0.02, 0.05])
    )
    estimate = rivals.aligned_ellipsoid(rivals.Rests.of(posed(TWELVE_POSES, D)), GRAVITY)
    np.testing.assert_allclose(estimate.D, D, atol=1e-4)


@pytest.mark.parametrize(
    ("turns", "method", "why"),
    [
        (SIX_FACES[:3], "six_positions", r"no rest with \+x, -x up"),
        (SIX_FACES, "ellipsoid", "6 rests, needs 9"),
        (np.tile([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], (5, 1)), "ellipsoid", "leave the ellipsoid open"),
    ],
    ids=["a face missing", "too few rests", "two orientations"],
)
def test_data_that_do_not_suit_a_method_are_refused_with_the_reason(turns, method, why):
    rests = rivals.Rests.of(posed(turns))
    with pytest.raises(rivals.Unfit, match=why):
        getattr(rivals, method)(rests, GRAVITY)
