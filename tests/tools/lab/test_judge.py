import numpy as np
import pytest

from mpucal.calibration.rotation import rotation
from mpucal.simulated.sensor import SensorTruth
from tools.lab.judge import sph_rms, tilt_errors_deg

RNG = np.random.default_rng(0)
D = np.eye(3) + 0.1 * RNG.normal(size=(3, 3))
TRUTH = SensorTruth(D, np.array([0.5, -0.2, 0.1]), np.eye(3), np.zeros(3), 9.82)


def sphere(n):
    k = np.arange(n) + 0.5
    z, longitude = 1 - 2 * k / n, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(longitude), across * np.sin(longitude), z], axis=1)


def test_sph_rms_is_the_mean_over_a_sphere_of_directions():
    s = 9.82 * sphere(20000)
    D_hat, b_hat = D + 0.02 * RNG.normal(size=(3, 3)), np.array([0.4, -0.1, 0.2])
    error = (s @ D.T + TRUTH.b_a - b_hat) @ np.linalg.inv(D_hat).T - s
    assert sph_rms(TRUTH, D_hat, b_hat) == pytest.approx(np.sqrt((error**2).sum(1).mean()), rel=1e-4)


@pytest.mark.parametrize(("phi", "expected"), [((2, 0, 0), (2, 0)), ((0, -3, 0), (0, 3))], ids=["roll", "pitch"])
def test_a_tilted_estimate_is_off_by_its_tilt(phi, expected):
    level = np.tile([0.0, 0.0, 9.82], (5, 1))
    np.testing.assert_allclose(tilt_errors_deg(level, level @ rotation(np.radians(phi)).T), expected, atol=1e-9)
