"""Filters of the kernel, compared with NumPy twins, differences, each other, and on each instruction set."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.likelihood import evaluate, trace, value
from mpucal.calibration.parameters import ACCEL, HAND, IMU, NAMES
from mpucal.calibration.problem import SERIES, SERIES_OF_A_HAND, Problem, Series
from mpucal.kernel import _kernel
from tools.lab.reference import evaluate_hand_reference, evaluate_reference, gains, innovations


@pytest.fixture(scope="module")
def hand_problem(hand_series, flat):
    return Problem(hand_series, flat, 9.82, huber=2.0)


@pytest.fixture(scope="module")
def exact_problem(hand_series, flat):
    return Problem(Series(**hand_series.arrays(SERIES)), flat, 9.82)


def assert_equal(ours, twin):
    assert pytest.approx(twin.V, rel=1e-10) == ours.V
    assert ours.squares == pytest.approx(twin.squares, rel=1e-10)
    np.testing.assert_allclose(ours.gradient, twin.gradient, rtol=1e-8, atol=1e-8 * abs(twin.gradient).max())
    np.testing.assert_allclose(ours.fisher, twin.fisher, rtol=1e-8, atol=1e-8 * abs(twin.fisher).max())


def on_each_instruction_set(problem, theta, parameters):
    """Return the evaluation by the best and by the portable build of a filter."""
    results = []
    for name in ("portable", "best"):
        _kernel.use_instruction_set(name)
        results.append(evaluate(problem, theta, parameters))
    return results


def assert_hand_equals_its_twin(problem, theta):
    """Compare each build with the twin, which is evaluated once, since Python takes a thousand times as long."""
    twin = evaluate_hand_reference(problem, theta)
    for ours in on_each_instruction_set(problem, theta, HAND):
        assert_equal(ours, twin)


@pytest.mark.parametrize("parameters", [ACCEL, IMU])
def test_the_exact_filter_equals_its_numpy_twin(exact_problem, theta, parameters, instruction_set):
    assert_equal(evaluate(exact_problem, theta, parameters), evaluate_reference(exact_problem, theta, parameters))


# Each loss at the edge of large innovations and far from it, and each length of a hand's memory.
CONSTANTS = [
    (np.inf, 1.0, 1.0),
    (np.inf, 1.0, 50.0),
    (2.0, 1.0, 5.0),
    (2.0, 0.0, 5.0),
    (2.0, 0.0, 50.0),
    (0.5, 0.0, 1.0),
]


@pytest.mark.parametrize(("huber", "tail", "lam"), CONSTANTS)
def test_the_hand_filter_equals_its_numpy_twin(hand_problem, theta, huber, tail, lam):
    assert_hand_equals_its_twin(replace(hand_problem, huber=huber, tail=tail, lam=lam), theta)


@pytest.mark.parametrize("without", ["r_scale", "q_scale", "q_extra"])
def test_a_missing_series_of_the_exact_filter_has_its_neutral_value(exact_problem, theta, without):
    part = replace(exact_problem, series=replace(exact_problem.series, **{without: None}))
    assert_equal(evaluate(part, theta, IMU), evaluate_reference(part, theta, IMU))


@pytest.mark.parametrize("without", ["r_scale", "q_scale", "q_extra", "r_extra", "jerk", "reset", "lever"])
def test_a_missing_series_of_the_hand_filter_has_its_neutral_value(hand_problem, theta, without):
    missing = ("rate", "alpha") if without == "lever" else (without,)
    series = replace(hand_problem.series, **dict.fromkeys(missing))
    assert_hand_equals_its_twin(replace(hand_problem, series=series), theta)


def test_the_exact_gradient_equals_central_differences(exact_problem, theta):
    exact = evaluate(exact_problem, theta, IMU)
    scale = np.sqrt(np.diag(exact.fisher))
    for i, name in enumerate(NAMES[:IMU]):
        # The step is in units of the parameter's own information, extrapolated (Richardson) to fourth order.
        step = np.zeros(IMU)
        step[i] = 0.02 / scale[i]
        V = [evaluate(exact_problem, theta.moved(k * step), 0).V for k in (-2, -1, 1, 2)]
        difference = (8 * (V[2] - V[1]) - (V[3] - V[0])) / (12 * step[i])
        assert exact.gradient[i] == pytest.approx(difference, rel=1e-6, abs=1e-6 * scale[i]), name


def test_the_hand_gradient_and_fisher_equal_central_differences_with_fixed_gains(hand_problem, theta):
    some = {name: value[95:115] for name, value in vars(hand_problem.series).items()}
    problem = replace(hand_problem, series=Series(**some))
    ours, held = evaluate(problem, theta, HAND), gains(problem, theta)
    e = innovations(problem, theta, held)
    scale = 0.001 / np.sqrt(np.diag(ours.fisher))
    de = []
    for i in range(HAND):
        step = np.zeros(HAND)
        step[i] = scale[i]
        before, after = (innovations(problem, theta.moved(k * step), held) for k in (-1, 1))
        de.append((after - before) / (2 * step[i]))
    weighted = np.array([gain.w * gain.Si for gain in held])
    gradient = np.einsum("pna,nab,nb->p", de, weighted, e)
    fisher = np.einsum("pna,nab,qnb->pq", de, weighted, de, optimize=True)
    np.testing.assert_allclose(ours.gradient * scale, gradient * scale, atol=1e-8)
    np.testing.assert_allclose(ours.fisher * np.outer(scale, scale), fisher * np.outer(scale, scale), atol=1e-11)


def test_the_hand_filter_without_a_hand_is_the_exact_one(hand_problem, theta):
    series = replace(hand_problem.series, **dict.fromkeys(SERIES_OF_A_HAND))
    at = replace(hand_problem, series=series, huber=np.inf)
    assert value(at, theta) == pytest.approx(evaluate(at, theta, 0).V, rel=1e-12)


def test_without_samples_only_the_flat_mean_counts(hand_problem, theta, instruction_set):
    none = replace(hand_problem, series=Series(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)))
    assert_equal(evaluate(none, theta, HAND), evaluate_hand_reference(none, theta))
    assert trace(none, theta).s.shape == (0, 3)


def test_the_value_alone_equals_the_value_with_derivatives(exact_problem, hand_problem, theta, instruction_set):
    assert pytest.approx(evaluate(exact_problem, theta, IMU).V, rel=1e-14) == evaluate(exact_problem, theta, 0).V
    assert pytest.approx(value(hand_problem, theta), rel=1e-14) == evaluate(hand_problem, theta, HAND).V


@pytest.mark.parametrize("parameters", [IMU, HAND])
def test_both_instruction_sets_agree(exact_problem, hand_problem, theta, parameters):
    problem = hand_problem if parameters == HAND else exact_problem
    portable, best = on_each_instruction_set(problem, theta, parameters)
    assert pytest.approx(portable.V, rel=1e-12) == best.V
    np.testing.assert_allclose(best.gradient, portable.gradient, atol=1e-10 * abs(portable.gradient).max())


def test_a_trace_has_the_innovations_of_the_value(hand_problem, theta, instruction_set):
    at = trace(hand_problem, theta)
    assert (at.innovation**2).sum() == pytest.approx(evaluate(hand_problem, theta, HAND).squares, rel=1e-12)
    np.testing.assert_allclose(np.linalg.norm(at.s, axis=1), hand_problem.gravity, rtol=1e-12)
    assert (at.a[[100, 160]] == 0.0).all()
    assert abs(at.a[[99, 101, 159, 162]]).min() > 0.0


def test_a_trace_follows_a_hand_that_shakes(theta, flat):
    n, g = 4000, 9.82
    rng = np.random.default_rng(1)
    t = 0.005 * np.arange(1, n + 1)
    a = np.stack([np.sin(5.0 * t + k) for k in range(3)], axis=1)
    still = replace(theta, K=np.eye(3), b_omega=np.zeros(3), r=np.zeros(3))
    y = (g * still.u + a) @ theta.D.T + theta.b_a + rng.normal(0.0, 0.01, (n, 3))
    rest = g * theta.D @ still.u + theta.b_a
    quiet = replace(flat, y=rest, Sigma_a=np.full(3, 1e-4), Sigma_omega=np.full(3, 1e-8))
    series = Series(y, np.zeros((n, 3)), np.full(n, 0.005), jerk=np.full(n, 30.0))
    seen = trace(Problem(series, quiet, g), still)
    assert np.sqrt(np.mean((seen.a - a)[1000:] ** 2)) < 0.1 * np.sqrt(np.mean(a**2))
    assert abs(seen.s - g * still.u).max() < 0.05


@pytest.mark.parametrize(
    ("series", "constants", "message"),
    [
        ({"y": np.zeros((4, 3))}, {}, "y holds 12"),
        ({"q_extra": np.zeros(7)}, {}, "q_extra holds 7"),
        ({"jerk": np.zeros(7)}, {}, "does not support jerk"),
        ({"rate": np.zeros((7, 3)), "alpha": np.zeros((7, 3))}, {}, "does not support rate, alpha"),
        ({}, {"huber": 2.0}, "does not support huber"),
    ],
    ids=["y", "q_extra", "jerk", "rate, alpha", "huber"],
)
def test_the_exact_filter_refuses_what_it_cannot_use(exact_problem, theta, series, constants, message):
    with pytest.raises(ValueError, match=message):
        evaluate(replace(exact_problem, series=replace(exact_problem.series, **series), **constants), theta, ACCEL)


@pytest.mark.parametrize(
    ("series", "constants", "message"),
    [
        ({"y": np.zeros((4, 3))}, {}, "y holds 12"),
        ({"rate": None}, {}, "come together"),
        ({"jerk": np.zeros(7)}, {}, "jerk holds 7"),
        ({"reset": np.zeros(7)}, {}, "reset holds 7"),
        ({}, {"lam": 0.0}, "lam"),
        ({}, {"lam": np.nan}, "lam"),
        ({}, {"tail": 0.5}, "tail"),
    ],
    ids=["y", "rate", "jerk", "reset", "lam 0", "lam nan", "tail"],
)
def test_the_hand_filter_refuses_what_it_cannot_use(hand_problem, theta, series, constants, message):
    with pytest.raises(ValueError, match=message):
        value(replace(hand_problem, series=replace(hand_problem.series, **series), **constants), theta)
