"""The exact filter against its NumPy twin, against differences, and against itself on another instruction set."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.likelihood import evaluate
from mpucal.calibration.parameters import ACCEL, IMU, NAMES
from mpucal.calibration.problem import Problem, Series
from mpucal.kernel import _kernel
from tools.lab.reference import evaluate_reference


@pytest.fixture(scope="module")
def series(hand_series):
    return Series(*(getattr(hand_series, name) for name in ("y", "omega", "dt", "r_scale", "q_scale", "q_extra")))


@pytest.fixture(scope="module")
def problem(series, flat):
    return Problem(series, flat, 9.82)


@pytest.mark.parametrize("parameters", [ACCEL, IMU])
def test_kernel_equals_its_numpy_twin(problem, theta, parameters, instruction_set):
    ours = evaluate(problem, theta, parameters)
    twin = evaluate_reference(problem, theta, parameters)
    assert pytest.approx(twin.V, rel=1e-10) == ours.V
    assert ours.squares == pytest.approx(twin.squares, rel=1e-10)
    np.testing.assert_allclose(ours.gradient, twin.gradient, rtol=1e-8, atol=1e-8 * abs(twin.gradient).max())
    np.testing.assert_allclose(ours.fisher, twin.fisher, rtol=1e-8, atol=1e-8 * abs(twin.fisher).max())


@pytest.mark.parametrize("without", ["r_scale", "q_scale", "q_extra"])
def test_a_missing_series_means_its_neutral_value(problem, theta, without, instruction_set):
    part = replace(problem, series=replace(problem.series, **{without: None}))
    ours, twin = (f(part, theta, IMU) for f in (evaluate, evaluate_reference))
    assert pytest.approx(twin.V, rel=1e-10) == ours.V
    np.testing.assert_allclose(ours.gradient, twin.gradient, rtol=1e-8, atol=1e-8 * abs(twin.gradient).max())


def test_gradient_equals_central_differences(problem, theta):
    exact = evaluate(problem, theta, IMU).gradient
    scale = np.sqrt(np.diag(evaluate(problem, theta, IMU).fisher))
    for i, name in enumerate(NAMES[:IMU]):
        # a step in units of the parameter's own information, extrapolated (Richardson) to fourth order
        step = np.zeros(IMU)
        step[i] = 0.02 / scale[i]
        V = [evaluate(problem, theta.moved(k * step), 0).V for k in (-2, -1, 1, 2)]
        difference = (8 * (V[2] - V[1]) - (V[3] - V[0])) / (12 * step[i])
        assert exact[i] == pytest.approx(difference, rel=1e-6, abs=1e-6 * scale[i]), name


def test_the_value_alone_is_the_value_with_derivatives(problem, theta):
    assert pytest.approx(evaluate(problem, theta, IMU).V, rel=1e-14) == evaluate(problem, theta, 0).V


def test_both_instruction_sets_agree(problem, theta):
    results = {}
    for name in ("best", "portable"):
        _kernel.use_instruction_set(name)
        results[name] = evaluate(problem, theta, IMU)
    _kernel.use_instruction_set("best")
    assert pytest.approx(results["portable"].V, rel=1e-12) == results["best"].V
    scale = abs(results["portable"].gradient).max()
    np.testing.assert_allclose(results["best"].gradient, results["portable"].gradient, atol=1e-10 * scale)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"y": np.zeros((4, 3))}, "y holds 12"),
        ({"q_extra": np.zeros(7)}, "q_extra holds 7"),
        ({"jerk": np.zeros(7)}, "knows no jerk"),
        ({"rate": np.zeros((7, 3)), "alpha": np.zeros((7, 3))}, "knows no rate, alpha"),
    ],
    ids=lambda change: ", ".join(change) if isinstance(change, dict) else "",
)
def test_what_the_filter_cannot_use_is_refused(problem, theta, change, message):
    with pytest.raises(ValueError, match=message):
        evaluate(replace(problem, series=replace(problem.series, **change)), theta, ACCEL)


def test_a_threshold_is_refused(problem, theta):
    with pytest.raises(ValueError, match="knows no huber"):
        evaluate(replace(problem, huber=2.0), theta, ACCEL)
