"""Tremor of a hand at rest, compared with integrals of its autocovariance and recordings that follow it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from scipy.spatial.transform import Rotation

from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.rests.limits import QUIET
from mpucal.rests.tremor import fit_lambda, level_rests, mean_variance

RATE_HZ, REST_S, NOISE_MPS2 = 100.0, 3.0, 0.02


@pytest.mark.parametrize("x", [0.1, 1.0, 5.0, 20.0, 80.0])
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


@pytest.mark.parametrize("lam", [6.0, 12.0, 25.0])
def test_lambda_is_found(lam):
    found = [
        fit_lambda(level_rests(recording, flat, runs), recording, flat, runs, 1.0)
        for recording, flat, runs in (held(lam, 0.1, seed) for seed in range(4))
    ]
    assert np.exp(np.mean(np.log(found))) == pytest.approx(lam, rel=0.25)


def test_a_board_that_lies_has_no_law():
    recording, flat, runs = held(10.0, 1e-6, 0)
    assert fit_lambda(level_rests(recording, flat, runs), recording, flat, runs, 17.0) == 17.0


def test_a_turn_that_the_gyroscope_sees_is_carried_away():
    n = 300
    rate = np.radians(3.0) * np.array([0.6, -0.8, 0.2])
    attitude = Rotation.from_rotvec(np.outer(np.arange(n) / RATE_HZ, rate))
    acc = attitude.inv().apply([0.0, 0.0, 9.81])
    recording = Recording.from_arrays(np.arange(n) / RATE_HZ, acc, np.tile(rate, (n, 1)), flat=(0, 2))
    flat = flat_statistics(recording, (0, 2))
    flat = type(flat)(**{**vars(flat), "b_omega": np.zeros(3)})
    still = level_rests(recording, flat, np.array([[0, n]]))
    assert np.ptp(acc, axis=0).max() > 0.5
    assert np.ptp(still, axis=0).max() < 0.01


def test_a_hand_that_trembles_by_two_degrees_a_second_rests():
    rng = np.random.default_rng(2)
    t = np.arange(4000) / RATE_HZ
    gyr = 0.001 * rng.standard_normal((4000, 3))
    gyr[1000:] += np.radians(2.0) * np.sqrt(2.0) * np.sin(2.0 * np.pi * 8.0 * t[1000:, None] + [0.0, 1.0, 2.0])
    moves = (t > 10.0) & (t % 5.0 < 1.0)
    gyr[moves, 1] += 1.0
    acc = [0.0, 0.0, 9.81] + 0.05 * rng.standard_normal((4000, 3))
    recording = Recording.from_arrays(t, acc, gyr, flat=(0, 900))
    flat = flat_statistics(recording, (0, 900))
    runs = RestFinder(recording, flat).typical()
    assert np.sum(runs[:, 1] - runs[:, 0] > 3.0 * RATE_HZ) == 7
    assert len(RestFinder(recording, flat).within(QUIET)) == 1


@pytest.mark.parametrize(("rate_hz", "share"), [(20.0, 0.8), (50.0, 0.85), (100.0, 0.9)])
def test_a_table_that_is_quieter_than_the_flat_segment_has_no_tremor(rate_hz, share):
    for seed in range(8):
        rng = np.random.default_rng(seed)
        n = int(60.0 * rate_hz)
        gyr = 0.004 * np.sqrt(share) * rng.standard_normal((n, 3))
        gyr[: n // 6] /= np.sqrt(share)
        gyr[n // 2 : n // 2 + int(2.0 * rate_hz)] += 0.5
        acc = [0.0, 0.0, 9.81] + 0.03 * rng.standard_normal((n, 3))
        recording = Recording.from_arrays(np.arange(n) / rate_hz, acc, gyr, flat=(0, n // 6))
        flat = flat_statistics(recording, recording.flat)
        np.testing.assert_array_equal(RestFinder(recording, flat).typical(), RestFinder(recording, flat).within(QUIET))
