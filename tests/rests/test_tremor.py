"""Tremor of a hand at rest, compared with integrals of its autocovariance and recordings that follow it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.rests.limits import QUIET
from mpucal.rests.tremor import fit_lambda, level_rests, mean_variance

RATE_HZ, REST_S, NOISE_MPS2 = 100.0, 3.0, 0.02


@pytest.mark.parametrize("x", [0.1, 5.0, 80.0])
def test_the_variance_of_a_mean_is_the_integral_of_the_autocovariance(x):
    def integrand(u):
        return 2.0 / x**2 * (x - u) * np.exp(-u) * (1.0 - 5.0 * u / 3.0 + u * u / 3.0)

    assert mean_variance(np.array([x]))[0] == pytest.approx(scipy.integrate.quad(integrand, 0.0, x)[0], rel=1e-6)


def travel(lam, sigma, n, rng):
    """(n, 3) m/s^2 of a position with three poles at lam, exactly discretised, from its steady state on."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(lam**3), -3.0 * lam**2, -3.0 * lam]])
    steady = scipy.linalg.solve_continuous_lyapunov(A, -np.diag([0.0, 0.0, 16.0 * lam / 3.0 * sigma**2]))
    F = scipy.linalg.expm(A / RATE_HZ)
    noise = np.linalg.cholesky(steady - F @ steady @ F.T + 1e-18 * np.eye(3))
    state = np.linalg.cholesky(steady + 1e-24 * np.eye(3)) @ rng.standard_normal((3, 3))
    acc = np.empty((n, 3))
    for k in range(n):
        acc[k] = state[2]
        state = F @ state + noise @ rng.standard_normal((3, 3))
    return acc


def held(lam, sigma, seed, rests=14):
    """A board on a table, and then in the hand: rests of the law, all in one orientation, and their runs."""
    rng = np.random.default_rng(seed)
    n = int(REST_S * RATE_HZ)
    acc = np.concatenate([np.zeros((n, 3)), *(travel(lam, sigma, n, rng) for _ in range(rests))])
    acc += [0.0, 0.0, 9.81] + NOISE_MPS2 * rng.standard_normal(acc.shape)
    gyr = 0.001 * rng.standard_normal(acc.shape)
    recording = Recording.from_arrays(np.arange(len(acc)) / RATE_HZ, acc, gyr, flat=(0, n))
    return recording, flat_statistics(recording, (0, n)), np.array([(k * n, (k + 1) * n) for k in range(1, rests + 1)])


@pytest.mark.parametrize("lam", [6.0, 25.0])
def test_lambda_is_found(lam):
    found = [
        fit_lambda(level_rests(recording, flat, runs), recording, flat, runs, 1.0)
        for recording, flat, runs in (held(lam, 0.1, seed) for seed in range(3))
    ]
    assert np.exp(np.mean(np.log(found))) == pytest.approx(lam, rel=0.25)


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
