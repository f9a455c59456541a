import numpy as np
import pytest

from mpucal.calibration.uncertainty import propagate

G = 9.82
D = np.array([[1.1, 0.05, -0.1], [0.2, 0.8, 0.0], [-0.05, 0.1, 0.9]])


def covariance(seed=0, size=0.01):
    A = size * np.random.default_rng(seed).standard_normal((12, 12))
    return A @ A.T / 12


def test_it_is_the_spread_of_calibrated_measurements():
    C = covariance()
    rng = np.random.default_rng(1)
    s = rng.standard_normal((4000, 3))
    s *= G / np.linalg.norm(s, axis=1, keepdims=True)
    drawn = rng.multivariate_normal(np.concatenate([D.ravel(), np.zeros(3)]), C, 4000)
    y = s @ D.T
    calibrated = np.linalg.solve(drawn[:, :9].reshape(-1, 3, 3), (y - drawn[:, 9:])[..., None])[..., 0]
    error = calibrated - s
    known = propagate(D, C, G)
    assert known.rms_mps2 == pytest.approx(np.sqrt((error**2).sum(1).mean()), rel=0.03)
    along = np.linalg.norm(calibrated, axis=1) - G
    assert known.magnitude_mps2 == pytest.approx(np.sqrt((along**2).mean()), rel=0.03)
    cosine = (calibrated * s).sum(1) / np.linalg.norm(calibrated, axis=1) / G
    assert known.direction_rad == pytest.approx(np.sqrt((np.arccos(cosine) ** 2).mean()), rel=0.03)


@pytest.mark.parametrize("axis", [0, 1, 2], ids="xyz")
def test_a_gain_that_is_not_known_is_worst_along_its_axis(axis):
    C = 1e-8 * np.eye(12)
    C[4 * axis, 4 * axis] = 0.01**2
    known = propagate(np.eye(3), C, G)
    assert abs(known.worst[axis]) > 0.95
    assert np.linalg.norm(known.worst) == pytest.approx(1.0)
