"""The hand's filter against its NumPy twin, against differences with the gains held, and against the exact filter."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.likelihood import evaluate, trace, value
from mpucal.calibration.parameters import HAND
from mpucal.calibration.problem import Problem, Series
from mpucal.kernel import _kernel
from tools.lab.reference import evaluate_hand_reference, gains, innovations


@pytest.fixture(scope="module")
def problem(hand_series, flat):
    return Problem(hand_series, flat, 9.82, huber=2.0)


def assert_equal(ours, twin):
    assert pytest.approx(twin.V, rel=1e-10) == ours.V
    assert ours.squares == pytest.approx(twin.squares, rel=1e-10)
    np.testing.assert_allclose(ours.gradient, twin.gradient, rtol=1e-8, atol=1e-8 * abs(twin.gradient).max())
    np.testing.assert_allclose(ours.fisher, twin.fisher, rtol=1e-8, atol=1e-8 * abs(twin.fisher).max())


def assert_equals_its_twin(problem, theta):
    """With each instruction set; the twin, in Python, takes a thousand times as long."""
    twin = evaluate_hand_reference(problem, theta)
    best = evaluate(problem, theta, HAND)
    _kernel.use_instruction_set("portable")
    portable = evaluate(problem, theta, HAND)
    _kernel.use_instruction_set("best")
    assert_equal(best, twin)
    assert_equal(portable, twin)


# each loss at the edge of what is huge and far from it, and each length of a hand's memory
CONSTANTS = [
    (np.inf, 1.0, 1.0),
    (np.inf, 1.0, 50.0),
    (2.0, 1.0, 5.0),
    (2.0, 0.0, 5.0),
    (2.0, 0.0, 50.0),
    (0.5, 0.0, 1.0),
]


@pytest.mark.parametrize(("huber", "tail", "lam"), CONSTANTS)
def test_kernel_equals_its_numpy_twin(problem, theta, huber, tail, lam):
    assert_equals_its_twin(replace(problem, huber=huber, tail=tail, lam=lam), theta)


@pytest.mark.parametrize("without", ["r_scale", "q_scale", "q_extra", "r_extra", "jerk", "reset", "lever"])
def test_a_missing_series_means_its_neutral_value(problem, theta, without):
    missing = ("rate", "alpha") if without == "lever" else (without,)
    assert_equals_its_twin(replace(problem, series=replace(problem.series, **dict.fromkeys(missing))), theta)


def test_gradient_and_fisher_equal_central_differences_with_the_gains_held(problem, theta):
    some = {name: value[95:115] for name, value in vars(problem.series).items()}
    problem = replace(problem, series=Series(**some))
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


def test_a_hand_that_keeps_still_leaves_the_exact_filter(problem, theta):
    series = replace(problem.series, rate=None, alpha=None, r_extra=None, jerk=None, reset=None)
    at = replace(problem, series=series, huber=np.inf)
    assert value(at, theta) == pytest.approx(evaluate(at, theta, 0).V, rel=1e-12)


def test_without_samples_the_flat_mean_alone_counts(problem, theta, instruction_set):
    none = replace(problem, series=Series(*(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))))
    assert_equal(evaluate(none, theta, HAND), evaluate_hand_reference(none, theta))
    assert trace(none, theta).s.shape == (0, 3)


def test_the_value_alone_is_the_value_with_derivatives(problem, theta, instruction_set):
    assert pytest.approx(value(problem, theta), rel=1e-14) == evaluate(problem, theta, HAND).V


def test_both_instruction_sets_agree(problem, theta):
    results = {}
    for name in ("best", "portable"):
        _kernel.use_instruction_set(name)
        results[name] = evaluate(problem, theta, HAND)
    _kernel.use_instruction_set("best")
    assert pytest.approx(results["portable"].V, rel=1e-12) == results["best"].V
    scale = abs(results["portable"].gradient).max()
    np.testing.assert_allclose(results["best"].gradient, results["portable"].gradient, atol=1e-10 * scale)


def test_trace_holds_the_innovations_of_the_value(problem, theta, instruction_set):
    at = trace(problem, theta)
    assert (at.innovation**2).sum() == pytest.approx(evaluate(problem, theta, HAND).squares, rel=1e-12)
    np.testing.assert_allclose(np.linalg.norm(at.s, axis=1), problem.gravity, rtol=1e-12)
    assert (at.a[[100, 160]] == 0.0).all()
    assert abs(at.a[[99, 101, 159, 162]]).min() > 0.0


def test_trace_follows_a_hand_that_shakes(theta, flat):
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
    ("change", "message"),
    [
        ({"y": np.zeros((4, 3))}, "y holds 12"),
        ({"rate": None}, "come together"),
        ({"jerk": np.zeros(7)}, "jerk holds 7"),
        ({"reset": np.zeros(7)}, "reset holds 7"),
    ],
    ids=lambda change: next(iter(change)) if isinstance(change, dict) else "",
)
def test_wrong_lengths_are_refused(problem, theta, change, message):
    with pytest.raises(ValueError, match=message):
        value(replace(problem, series=replace(problem.series, **change)), theta)


@pytest.mark.parametrize("change", [{"lam": 0.0}, {"lam": np.nan}, {"tail": 0.5}], ids=str)
def test_constants_without_meaning_are_refused(problem, theta, change):
    with pytest.raises(ValueError, match=next(iter(change))):
        value(replace(problem, **change), theta)
