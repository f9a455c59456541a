"""Filters of the kernel, compared with NumPy twins, differences, each other, and on each instruction set."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.likelihood import evaluate, trace
from mpucal.calibration.parameters import ACCEL, HAND, IMU, NAMES, SENSITIVE
from mpucal.calibration.problem import SERIES, Problem, Series
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
CONSTANTS = [(np.inf, 1.0, 50.0), (2.0, 0.0, 5.0), (0.5, 0.0, 1.0)]


@pytest.mark.parametrize(("huber", "tail", "lam"), CONSTANTS)
def test_the_hand_filter_equals_its_numpy_twin(hand_problem, theta, huber, tail, lam):
    assert_hand_equals_its_twin(replace(hand_problem, huber=huber, tail=tail, lam=lam), theta)


def without(problem, *series):
    return replace(problem, series=replace(problem.series, **dict.fromkeys(series)))


def test_a_missing_series_of_the_exact_filter_has_its_neutral_value(exact_problem, theta):
    part = without(exact_problem, "r_scale", "q_scale", "q_extra")
    assert_equal(evaluate(part, theta, IMU), evaluate_reference(part, theta, IMU))


@pytest.mark.parametrize("missing", [("r_scale", "q_extra", "jerk"), ("q_scale", "r_extra", "reset", "rate", "alpha")])
def test_a_missing_series_of_the_hand_filter_has_its_neutral_value(hand_problem, theta, missing):
    assert_hand_equals_its_twin(without(hand_problem, *missing), theta)


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
    some = {name: value[45:57] for name, value in vars(hand_problem.series).items() if value is not None}
    series = Series(**some, force=some["y"][:, [1, 2, 0]])
    problem = replace(hand_problem, series=series)
    each, held = on_each_instruction_set(problem, theta, SENSITIVE), gains(problem, theta)
    e = innovations(problem, theta, held)
    scale = 0.001 / np.sqrt(np.diag(each[0].fisher))

    def after(step):
        rates = series.omega - series.force @ step[HAND:].reshape(3, 3).T
        return innovations(replace(problem, series=replace(series, omega=rates)), theta.moved(step[:HAND]), held)

    de = [(after(step) - after(-step)) / (2 * step[i]) for i, step in enumerate(np.diag(scale))]
    weighted = np.array([gain.w * gain.Si for gain in held])
    gradient = np.einsum("pna,nab,nb->p", de, weighted, e)
    fisher = np.einsum("pna,nab,qnb->pq", de, weighted, de, optimize=True)
    for ours in each:
        np.testing.assert_allclose(ours.gradient * scale, gradient * scale, atol=1e-8)
        np.testing.assert_allclose(ours.fisher * np.outer(scale, scale), fisher * np.outer(scale, scale), atol=1e-11)


def test_without_samples_only_the_flat_mean_counts(hand_problem, theta, instruction_set):
    none = replace(hand_problem, series=Series(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)))
    assert_equal(evaluate(none, theta, HAND), evaluate_hand_reference(none, theta))
    assert trace(none, theta).s.shape == (0, 3)


def test_a_trace_has_the_innovations_of_the_value(hand_problem, theta, instruction_set):
    at = trace(hand_problem, theta)
    assert (at.innovation**2).sum() == pytest.approx(evaluate(hand_problem, theta, HAND).squares, rel=1e-12)
    np.testing.assert_allclose(np.linalg.norm(at.s, axis=1), hand_problem.gravity, rtol=1e-12)


@pytest.mark.parametrize(
    ("filter_", "series", "constants", "message"),
    [
        ("exact", {"y": np.zeros((4, 3))}, {}, "y holds 12"),
        ("exact", {"jerk": np.zeros(7)}, {}, "does not support jerk"),
        ("exact", {"rate": np.zeros((7, 3)), "alpha": np.zeros((7, 3))}, {}, "does not support rate, alpha"),
        ("exact", {}, {"huber": 2.0}, "does not support huber"),
        ("hand", {"y": np.zeros((4, 3))}, {}, "y holds 12"),
        ("hand", {"rate": None}, {}, "come together"),
        ("hand", {"reset": np.zeros(7)}, {}, "reset holds 7"),
        ("hand", {}, {"lam": np.nan}, "lam"),
        ("hand", {}, {"tail": 0.5}, "tail"),
    ],
)
def test_input_that_a_filter_cannot_use_is_refused(
    exact_problem, hand_problem, theta, filter_, series, constants, message
):
    problem, parameters = (exact_problem, ACCEL) if filter_ == "exact" else (hand_problem, HAND)
    with pytest.raises(ValueError, match=message):
        evaluate(replace(problem, series=replace(problem.series, **series), **constants), theta, parameters)
