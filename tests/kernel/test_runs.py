"""Passes over runs of samples, compared with NumPy and SciPy on the same data."""

from functools import reduce
from operator import mul

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.kernel import _kernel


@pytest.fixture
def x():
    return np.random.default_rng(4).standard_normal((200, 3))


def test_a_turn_is_the_product_of_its_steps_and_turns_vectors_that_enter_on_the_way(x):
    x[:100] *= 0.3
    phi, entering = x[:100], x[100:]
    turn, sums = np.eye(3), np.zeros((3, 3, 3))
    for step, vector in zip(Rotation.from_rotvec(phi).as_matrix(), entering, strict=True):
        sums = np.einsum("ai,ijk->ajk", step, sums + np.einsum("ij,k->ijk", np.eye(3), vector))
        turn = step @ turn
    given, arrived = _kernel.turn(x, np.array([[7, 7], [0, 100]]), np.roll(x, 100, axis=0))
    np.testing.assert_allclose(given, [np.eye(3), turn], atol=1e-13)
    np.testing.assert_allclose(arrived, [np.zeros((3, 3, 3)), sums], atol=1e-12)
    with pytest.raises(ValueError, match="not within"):
        _kernel.turn(x, np.array([[190, 201]]))


def test_lengths_of_vectors(x):
    for of in (x, x[::2], x[:0], np.arange(6).reshape(2, 3)):  # also of arrays that are copied first
        np.testing.assert_allclose(_kernel.lengths(of), np.linalg.norm(of, axis=1), rtol=1e-15)
    with pytest.raises(ValueError, match="holds 10 numbers, not 9"):
        _kernel.lengths(np.ones((5, 2)))


def test_means_and_variances_of_runs(x):
    runs = np.array([[0, 1], [5, 80], [70, 200]])
    mean, variance = _kernel.statistics(10.0 + x, runs)
    np.testing.assert_allclose(mean, [10.0 + x[a:b].mean(0) for a, b in runs], rtol=1e-13)
    np.testing.assert_allclose(variance, [x[a:b].var(0) for a, b in runs], atol=1e-13)
    for outside in ([[0, 201]], [[-1, 5]], [[5, 5]], [[0, (1 << 64) // 3 + 1]]):
        with pytest.raises(ValueError, match="a run is empty"):
            _kernel.statistics(x, np.array(outside))


@pytest.mark.parametrize("half", [0, 3, 500, (1 << 64) - 1])
def test_moving_means_use_the_samples_that_exist(x, half):
    wanted = [x[max(i - half, 0) : i + half + 1].mean(0) for i in range(len(x))]
    np.testing.assert_allclose(_kernel.moving_mean(x, half), wanted, atol=1e-13)


@pytest.mark.parametrize("size", [1, 7, 200])
def test_moving_statistics_are_of_whole_windows(x, size):
    mean, variance = _kernel.moving_statistics(10.0 + x, size)
    windows = np.lib.stride_tricks.sliding_window_view(10.0 + x, size, axis=0)
    np.testing.assert_allclose(mean, windows.mean(-1).T, rtol=1e-13)
    np.testing.assert_allclose(variance, windows.var(-1).T, atol=1e-12)
    for wrong in (0, 201):
        with pytest.raises(ValueError, match="a window is empty"):
            _kernel.moving_statistics(x, wrong)


@pytest.mark.parametrize("fresh", [0, 7, 1100, 2000])
def test_squared_differences_are_of_sums_that_end_with_the_last_elements(x, fresh):
    x, spans = np.tile(x, (8, 1)), np.array([1, 4, 64])
    n, wanted = len(x), np.zeros((3, 3))
    for i, m in enumerate(spans):
        for last in range(max(2 * m, n - fresh + 1), n + 1):
            wanted[:, i] += (x[last - m : last].sum(0) - x[last - 2 * m : last - m].sum(0)) ** 2
    np.testing.assert_allclose(_kernel.squared_differences(x.T.copy(), fresh, spans), wanted, rtol=1e-12)
    for wrong in ([0], [3], [2, 1], [1 << 21], [-1]):
        with pytest.raises(ValueError, match="powers of two"):
            _kernel.squared_differences(x, fresh, np.array(wrong))


def test_the_noise_is_that_of_fourth_differences(x):
    squares = np.zeros_like(x)
    squares[2:-2] = np.diff(x, 4, axis=0) ** 2 / 70.0
    wanted = [squares[max(i - 9, 0) : i + 10].mean(0) for i in range(len(x))]
    np.testing.assert_allclose(_kernel.noise_variance(x, 9), wanted, atol=1e-13)
    np.testing.assert_array_equal(_kernel.noise_variance(x[:4], 9), np.zeros((4, 3)))


def test_a_spike_is_of_one_word_and_back_with_the_next_sample(x):
    acc, rate = 0.01 * x, np.sin(0.05 * np.arange(len(x)))[:, None] + 0.001 * x
    rate[[1, 50, 198], [0, 2, 1]] += (3.0, -0.6, 0.9)
    rate[100:, 0] += 2.0  # a step stays
    rate[120] += 1.5  # a blow moves every word
    rate[150, 1] += 2.0
    acc[150, 0] += 2.0
    np.testing.assert_array_equal(_kernel.spikes(acc, rate), [[1, 0], [50, 2], [198, 1]])


def test_odds_of_stuck_bits():
    rng, errors, sound = np.random.default_rng(3), 0.1, 0.98
    counts, gap = rng.normal(0.0, (3.0, 300.0, 15000.0), (400, 3)).astype(np.int32), np.arange(400) % 97 == 50
    edges = np.array([0, 133, 134, 260])
    changed, steps = (counts[1:] ^ counts[:-1]) & 0xFFFF, np.maximum(np.abs(np.diff(counts, axis=0)), 1)
    for bit in range(16):
        halves = steps / 2.0**bit
        share = np.where(halves < 2.0, np.clip(2.0 / halves - 1.0, errors, sound), 0.5)
        odds = np.log(np.where(changed >> bit & 1, errors / share, (1.0 - errors) / (1.0 - share)))
        may = changed >= 2 << bit if bit < 15 else np.abs(np.diff(counts & 0x7FFF, axis=0)) > 0x7FFF - 0x7FF
        wanted = np.add.reduceat(np.where(may & ~gap[1:, None], odds, 0.0), edges)
        np.testing.assert_allclose(_kernel.stuck_odds(counts, gap, edges, errors, sound)[bit], wanted, atol=1e-11)
    for wrong in ([5, 3], [-1], [400]):
        with pytest.raises(ValueError, match="edges rise"):
            _kernel.stuck_odds(counts, gap, np.array(wrong), errors, sound)


def test_mean_rates_follow_a_coning_body():
    bias, angle, slow, t = np.array([0.1, -0.2, 0.3]), 0.2, 20.0, np.arange(302) / 100.0
    round_, zero = np.stack([np.cos(slow * t), np.sin(slow * t)]), np.zeros_like(t)
    at = Rotation.from_rotvec(angle * np.stack([*round_, zero], axis=1))
    across = np.stack([-round_[1], round_[0], zero], axis=1)
    rate = slow * (np.sin(angle) * across - (1.0 - np.cos(angle)) * np.array([0.0, 0.0, 1.0]))
    mean = _kernel.mean_rates(bias + rate, bias, np.diff(t)[1:]) - bias
    midpoint = 0.5 * (rate[1:-1] + rate[2:])
    miss, of_midpoint = (
        (at[1].inv() * at[-1] * reduce(mul, Rotation.from_rotvec(steps / 100.0)).inv()).magnitude()
        for steps in (mean, midpoint)
    )
    assert miss < 0.1 * of_midpoint
    with pytest.raises(ValueError, match="no rates before"):
        _kernel.mean_rates(rate[:5], bias, np.ones(5))
