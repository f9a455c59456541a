"""Noise density: that of simulated noise is found, and a hand's tremor is not taken for noise."""

import numpy as np
import pytest

from mpucal.doctor.measure import is_trembling, noise_density

RATE_HZ = 200.0


def white(seed, unit_rthz=0.004, seconds=20):
    """Draw white noise of one density, (n, 3)."""
    rng = np.random.default_rng(seed)
    return rng.normal(scale=unit_rthz * np.sqrt(RATE_HZ / 2), size=(int(seconds * RATE_HZ), 3))


def test_the_density_of_white_noise_is_found():
    found = np.array([noise_density(white(seed), RATE_HZ) for seed in range(10)])
    assert found.mean() == pytest.approx(0.004, rel=0.02)


def test_a_hands_tremor_is_recognised():
    """A hand trembles by 0.05 to 0.1 m/s^2 at 2 to 10 Hz."""
    t = np.arange(4000) / RATE_HZ
    shaking = 0.05 * np.sin(2 * np.pi * 6.0 * t)[:, None] * [1.0, 0.6, 0.8]
    assert is_trembling(white(2) + shaking, RATE_HZ)


@pytest.mark.parametrize("times", [1.0, 10.0], ids=["quiet", "noisy"])
def test_a_noisy_chip_is_no_hand(times):
    assert not any(is_trembling(white(seed, 0.004 * times), RATE_HZ) for seed in range(20))
