"""Tremor of a hand at rest, compared with integrals of its autocovariance and recordings that follow it."""

import numpy as np
import pytest
import scipy

from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.rests.limits import QUIET
from mpucal.rests.tremor import mean_variance, without_tremor

RATE_HZ, REST_S, NOISE_MPS2 = 100.0, 3.0, 0.02


@pytest.mark.parametrize("x", [0.1, 5.0, 80.0])
def test_the_variance_of_a_mean_is_the_integral_of_the_autocovariance(x):
    def integrand(u):
        return 2.0 / x**2 * (x - u) * np.exp(-u) * (1.0 - 5.0 * u / 3.0 + u * u / 3.0)

    assert mean_variance(np.array([x]))[0] == pytest.approx(scipy.integrate.quad(integrand, 0.0, x)[0], rel=1e-6)


def held(acceleration, share=0.75, hums=False):
    """Return the readings (n, 3) of a table and then of a hand with `acceleration`, and 14 rests without tremor.

    hums : the table has that acceleration, too.
    """
    rng = np.random.default_rng(0)
    n = int(REST_S * RATE_HZ)
    t = np.arange(15 * n)[:, None] / RATE_HZ
    felt = np.where((t < REST_S) & (not hums), 0.0, acceleration(t))
    acc = felt + [0.0, 0.0, 9.81] + NOISE_MPS2 * rng.standard_normal((15 * n, 3))
    recording = Recording.from_arrays(t[:, 0], acc, 0.001 * rng.standard_normal(acc.shape), flat=(0, n))
    cut = round(0.5 * (1.0 - share) * n)
    runs = np.array([(k * n + cut, (k + 1) * n - cut) for k in range(1, 15)])
    return runs, acc, without_tremor(recording, flat_statistics(recording, (0, n)), runs, np.ones(14))


def trembling(t):
    return 0.4 * np.sin(2.0 * np.pi * np.array([9.0, 10.0, 11.0]) * t)


def test_the_low_pass_removes_a_tremor():
    _, _, hand = held(trembling)
    assert np.sqrt(hand.sway.max()) < 0.1 * 0.4 / np.sqrt(2.0)
    assert not hand.jitter.any()


def test_the_tremor_of_a_short_rest_stays_and_counts_as_noise_of_its_mean():
    runs, measured, hand = held(lambda t: 0.4 * np.sin(2.0 * np.pi * np.array([4.1, 4.5, 5.3]) * t), share=0.15)
    np.testing.assert_array_equal(hand.acc, measured)
    assert not hand.sway.any()
    means = [(measured[first:last] - [0.0, 0.0, 9.81]).mean(0) for first, last in runs]
    assert np.sqrt(hand.jitter.mean()) == pytest.approx(np.sqrt(np.mean(np.square(means))), rel=0.5)


def test_the_low_pass_leaves_a_sway():
    def swaying(t):
        return 0.1 * np.sin(2.0 * np.pi * np.array([0.4, 0.6, 0.8]) * t)

    runs, measured, hand = held(swaying)
    t = np.arange(len(measured))[:, None] / RATE_HZ
    for first, last in runs:
        away = (hand.acc - swaying(t) - [0.0, 0.0, 9.81])[first:last]
        assert np.sqrt(np.mean(away**2)) < 0.5 * NOISE_MPS2
        np.testing.assert_array_equal(hand.acc[last + 10 : last + 20], measured[last + 10 : last + 20])


def test_an_untouched_board_keeps_its_means_and_does_not_sway():
    runs, measured, hand = held(lambda t: 0.0)
    for first, last in runs:
        away = hand.acc[first:last].mean(0) - measured[first:last].mean(0)
        assert np.abs(away).max() < NOISE_MPS2 / np.sqrt(last - first)
    assert hand.sway.max() < 0.1 * NOISE_MPS2**2


def test_the_low_pass_removes_the_hum_of_a_table_that_hums_from_the_start():
    def skewed(t):  # its median is not its mean
        return 0.1 * (np.sin(2.0 * np.pi * 31.0 * t) + 0.5 * np.cos(2.0 * np.pi * 62.0 * t)) * [1.0, 0.0, 0.0]

    runs, measured, hand = held(skewed, hums=True)
    first, last = runs[3]
    assert abs(np.median(measured[first:last, 0])) > 0.01 > 3.0 * abs(np.median(hand.acc[first:last, 0]))
    assert not hand.sway.any()


def test_a_table_that_is_quieter_than_the_flat_segment_has_no_tremor():
    for seed in range(8):
        rng = np.random.default_rng(seed)
        gyr = 0.004 * np.sqrt(0.85) * rng.standard_normal((3000, 3))
        gyr[:500] /= np.sqrt(0.85)
        gyr[1500:1600] += 0.5
        acc = [0.0, 0.0, 9.81] + 0.03 * rng.standard_normal((3000, 3))
        recording = Recording.from_arrays(np.arange(3000) / 50.0, acc, gyr, flat=(0, 500))
        finder = RestFinder(recording, flat_statistics(recording, recording.flat))
        np.testing.assert_array_equal(finder.typical(), finder.within(QUIET))
