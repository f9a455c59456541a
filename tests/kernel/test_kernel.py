"""The kernel against its NumPy twin, against differences, and against itself on another instruction set."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.likelihood import NAMES, Problem, Series, Theta, evaluate, trace
from mpucal.calibration.model import Flat
from mpucal.calibration.reference import evaluate_reference
from mpucal.kernel import _kernel

N = 300


@pytest.fixture(scope="module")
def series():
    rng = np.random.default_rng(5)
    return Series(
        y=rng.normal([1.0, -2.0, 9.3], 0.4, (N, 3)),
        omega=rng.normal(0.2, 1.0, (N, 3)),
        dt=rng.uniform(0.004, 0.02, N),
        r_scale=rng.uniform(0.5, 3.0, N),
        q_scale=rng.uniform(0.5, 3.0, N),
        q_extra=rng.uniform(0.0, 1e-5, N),
        motion=rng.uniform(0.0, 1.0, N),
        rate=rng.normal(0.0, 1.0, (N, 3)),
        alpha=rng.normal(0.0, 3.0, (N, 3)),
    )


@pytest.fixture(scope="module")
def theta():
    rng = np.random.default_rng(6)
    K = rng.normal(0.0, 0.03, (3, 3))
    return Theta(
        D=np.eye(3) + rng.normal(0.0, 0.1, (3, 3)),
        b_a=rng.normal(0.0, 0.5, 3),
        b_omega=rng.normal(0.0, 0.1, 3),
        u=np.array([0.1, -0.2, np.sqrt(0.95)]),
        K=np.eye(3) + K + K.T,
        sigma_h=0.3,
        r=np.array([0.1, 0.2, -0.15]),
    )


@pytest.fixture(params=["best", "portable"])
def instruction_set(request):
    _kernel.use_instruction_set(request.param)
    yield request.param
    _kernel.use_instruction_set("best")


def problem(series, huber=np.inf):
    flat = Flat(
        0,
        1000,
        y=np.array([0.9, -2.1, 9.2]),
        b_omega=np.full(3, 0.1),
        Sigma_a=np.array([0.01, 0.02, 0.03]),
        Sigma_omega=np.array([1e-3, 2e-3, 3e-3]),
    )
    return Problem(series, flat, 9.82, huber)


@pytest.mark.parametrize("huber", [np.inf, 2.0, 0.5])
@pytest.mark.parametrize("parameters", [17, 23, 27])
def test_kernel_equals_its_numpy_twin(series, theta, parameters, huber, instruction_set):
    ours = evaluate(problem(series, huber), theta, parameters)
    twin = evaluate_reference(problem(series, huber), theta, parameters)
    assert pytest.approx(twin.V, rel=1e-10) == ours.V
    assert ours.squares == pytest.approx(twin.squares, rel=1e-10)
    np.testing.assert_allclose(ours.gradient, twin.gradient, rtol=1e-8, atol=1e-8 * abs(twin.gradient).max())
    np.testing.assert_allclose(ours.fisher, twin.fisher, rtol=1e-8, atol=1e-8 * abs(twin.fisher).max())


@pytest.mark.parametrize("without", ["r_scale", "q_scale", "q_extra", "motion", "lever"])
def test_a_missing_series_means_its_neutral_value(series, theta, without, instruction_set):
    missing = ("rate", "alpha") if without == "lever" else (without,)
    part = replace(series, **dict.fromkeys(missing))
    ours, twin = (f(problem(part), theta, 27) for f in (evaluate, evaluate_reference))
    assert pytest.approx(twin.V, rel=1e-10) == ours.V
    np.testing.assert_allclose(ours.gradient, twin.gradient, rtol=1e-8, atol=1e-8 * abs(twin.gradient).max())


@pytest.mark.parametrize("huber", [np.inf, 2.0])
def test_gradient_equals_central_differences(series, theta, huber):
    at = problem(series, huber)
    exact = evaluate(at, theta, 27).gradient
    scale = np.sqrt(np.diag(evaluate(at, theta, 27).fisher))
    for i, name in enumerate(NAMES):
        # a step in units of the parameter's own information, extrapolated (Richardson) to fourth order
        step = np.zeros(27)
        step[i] = 0.02 / scale[i]
        V = [evaluate(at, theta.moved(k * step), 0).V for k in (-2, -1, 1, 2)]
        difference = (8 * (V[2] - V[1]) - (V[3] - V[0])) / (12 * step[i])
        assert exact[i] == pytest.approx(difference, rel=1e-6, abs=1e-6 * scale[i]), name


def test_the_value_alone_is_the_value_with_derivatives(series, theta):
    at = problem(series, 2.0)
    assert pytest.approx(evaluate(at, theta, 27).V, rel=1e-14) == evaluate(at, theta, 0).V


def test_both_instruction_sets_agree(series, theta):
    results = {}
    for name in ("best", "portable"):
        _kernel.use_instruction_set(name)
        results[name] = evaluate(problem(series, 2.0), theta, 27)
    _kernel.use_instruction_set("best")
    assert pytest.approx(results["portable"].V, rel=1e-12) == results["best"].V
    scale = abs(results["portable"].gradient).max()
    np.testing.assert_allclose(results["best"].gradient, results["portable"].gradient, atol=1e-10 * scale)


def test_trace_holds_the_innovations_of_the_value(series, theta):
    at = problem(series)
    innovation, gravity = trace(at, theta)
    assert (innovation**2).sum() == pytest.approx(evaluate(at, theta, 0).squares, rel=1e-12)
    np.testing.assert_allclose(np.linalg.norm(gravity, axis=1), at.gravity, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"y": np.zeros((4, 3))}, "y holds 12"),
        ({"rate": None}, "come together"),
        ({"motion": np.zeros(7)}, "motion"),
    ],
)
def test_wrong_lengths_are_refused(series, theta, change, message):
    with pytest.raises(ValueError, match=message):
        evaluate(problem(replace(series, **change)), theta, 17)
