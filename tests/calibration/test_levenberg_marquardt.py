"""Minimiser, on problems whose solution is known otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration.initial_estimate import initialise
from mpucal.calibration.levenberg_marquardt import DECREMENT, MOST_ITERATIONS, _nearer, minimise
from mpucal.calibration.likelihood import evaluate
from mpucal.calibration.parameters import ACCEL, PLACES
from mpucal.calibration.problem import Problem, Series
from mpucal.calibration.theta import Prior
from mpucal.rests.flat import flat_statistics
from tools.lab.scenarios.recordings import paper_scenario

NOTHING = Prior.of()


@pytest.fixture(scope="module")
def problem():
    recording = paper_scenario(2, rate_hz=50).recording
    flat = flat_statistics(recording, recording.flat)
    return Problem(Series.after(recording, flat), flat, 9.82)


@pytest.fixture(scope="module")
def start(problem):
    return initialise(problem, problem.flat.b_omega)


def decrement(problem, minimum, prior=NOTHING):
    at = evaluate(problem, minimum.theta, ACCEL)
    gradient = at.gradient + prior.precision[:ACCEL] * (values(minimum.theta) - prior.mean[:ACCEL])
    free = minimum.free
    return 0.5 * gradient[free] @ np.linalg.solve(minimum.H[np.ix_(free, free)], gradient[free])


def values(theta):
    return np.concatenate([theta.D.ravel(), theta.b_a, [0.0, 0.0], theta.b_omega])


def test_it_ends_where_the_gradient_vanishes_and_nowhere_near_is_lower(problem, start):
    minimum = minimise(problem, start, ACCEL, NOTHING)
    assert minimum.converged
    assert decrement(problem, minimum) < DECREMENT
    rng = np.random.default_rng(0)
    L = np.linalg.cholesky(minimum.covariance())
    for _ in range(20):
        direction = rng.standard_normal(ACCEL)
        away = evaluate(problem, minimum.theta.moved(L @ direction / np.linalg.norm(direction)), 0).V
        # One standard deviation away, V is higher by about a half.
        assert minimum.V + 0.3 < away < minimum.V + 0.8


def test_it_finds_the_same_from_afar(problem, start):
    near = minimise(problem, start, ACCEL, NOTHING)
    far = replace(start, D=start.D + 0.2, b_a=start.b_a + 1.0)
    from_afar = minimise(problem, far, ACCEL, NOTHING)
    sd = np.sqrt(np.diag(near.covariance()))
    assert (np.abs(values(from_afar.theta) - values(near.theta)) < 0.1 * np.where(sd > 0, sd, 1.0)).all()
    assert from_afar.iterations > near.iterations


@pytest.mark.parametrize("name", ["D", "b_a", "b_omega"])
def test_what_is_fixed_stays(problem, start, name):
    minimum = minimise(problem, start, ACCEL, NOTHING, fixed=(name,))
    np.testing.assert_array_equal(getattr(minimum.theta, name), getattr(start, name))
    place = PLACES[name]
    assert not minimum.free[place].any()
    assert (minimum.covariance()[place] == 0.0).all()
    assert (np.diag(minimum.covariance())[minimum.free] > 0).all()


def test_a_tight_prior_wins_and_a_loose_one_is_forgotten(problem, start):
    free = minimise(problem, start, ACCEL, NOTHING)
    elsewhere = free.theta.b_a + 0.5
    tight = minimise(problem, start, ACCEL, Prior.of(b_a=(elsewhere, 1e-5)))
    loose = minimise(problem, start, ACCEL, Prior.of(b_a=(elsewhere, 1e3)))
    sd = np.sqrt(np.diag(free.covariance()))[PLACES["b_a"]]
    np.testing.assert_allclose(tight.theta.b_a, elsewhere, atol=1e-6)
    assert (np.abs(loose.theta.b_a - free.theta.b_a) < 0.1 * sd).all()
    assert tight.V > free.V + 1.0


def test_a_prior_and_the_data_are_weighted_by_their_information(problem, start):
    free = minimise(problem, start, ACCEL, NOTHING, until=1e-8)
    sd = np.sqrt(np.diag(free.covariance()))[9]
    prior = Prior.of(b_a=(free.theta.b_a + sd * np.eye(3)[0], [sd, 1e6, 1e6]))
    both = minimise(problem, start, ACCEL, prior, until=1e-8)
    assert both.theta.b_a[0] - free.theta.b_a[0] == pytest.approx(0.5 * sd, rel=0.1)
    assert np.sqrt(both.covariance()[9, 9]) == pytest.approx(sd / np.sqrt(2.0), rel=0.05)


@pytest.mark.parametrize(
    ("then", "risen", "accepted"),
    [(5.0, 0.9, True), (5.0, 1.1, False), (0.9, 100.0, True), (0.9, 300.0, False), (11.0, 0.5, False)],
)
def test_a_step_with_frozen_gains_may_raise_V_near_a_root(then, risen, accepted):  # noqa: N802
    """Judge steps from a decrement of 10: a search without such steps never reaches the root."""

    class At:
        def __init__(self, cost, decrement):
            self.V, self._decrement = cost, decrement

        def decrement(self, _free):
            return self._decrement

    assert _nearer(At(risen, then), At(0.0, 10.0), np.ones(1, bool), 10.0) == accepted


def test_a_valley_without_an_end_is_left_soon():
    recording = paper_scenario(0, rate_hz=20, turn_s=330.0).recording
    flat = flat_statistics(recording, recording.flat)
    slow = Problem(Series.after(recording, flat), flat, 9.82)
    minimum = minimise(slow, initialise(slow, flat.b_omega), ACCEL, Prior.of_sensor(flat, recording.sensor), most=1000)
    assert not minimum.converged
    assert minimum.iterations < MOST_ITERATIONS
