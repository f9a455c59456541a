"""First estimate: exact without noise, near enough for the minimiser with noise, and robust to gaps."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.calibration.initial_estimate import initialise
from mpucal.calibration.masks import mask, with_masks
from mpucal.calibration.problem import Problem, Series
from mpucal.calibration.rotation import rotation
from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics


def exact(D, b_a, u, n=400, seed=0, lost=()):
    """Return the problem of a sensor without noise, turned at random from u on, without `lost` samples."""
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(n + 100)
    rates = np.zeros((n + 100, 3))
    rates[100:] = np.repeat(rng.uniform(-4, 4, (n // 50, 3)), 50, axis=0)
    s, force = 9.82 * u, []
    for omega, following in zip(rates, np.append(rates[1:], rates[-1:], axis=0), strict=True):
        force.append(s)
        s = rotation(-0.01 * 0.5 * (omega + following)) @ s
    kept = np.delete(np.arange(n + 100), lost)
    acc = np.array(force) @ D.T + b_a
    recording = with_masks(Recording.from_arrays(t[kept], acc[kept], rates[kept], flat=(0, 99)))
    flat = flat_statistics(recording, recording.flat)
    return Problem(mask(Series.after(recording, flat), recording, flat), flat, 9.82)


def linear(problem, b_omega):
    """Return the start from a series as if it had no gaps."""
    whole = replace(problem, series=replace(problem.series, q_extra=None))
    return initialise(whole, b_omega)


@pytest.mark.parametrize("u", [(0, 0, 1), (0, 0, -1), (0.6, 0.8, 0), (-0.5, 0.5, np.sqrt(0.5))], ids=str)
def test_without_noise_it_is_exact_in_every_orientation(u):
    D = np.array([[1.3, 0.1, -0.2], [0.3, 0.6, 0.1], [0.0, -0.2, 0.9]])
    b_a = np.array([1.0, -0.5, 0.3])
    theta = initialise(exact(D, b_a, np.array(u)), np.zeros(3))
    np.testing.assert_allclose(theta.D, D, atol=2e-3)
    np.testing.assert_allclose(theta.b_a, b_a, atol=2e-2)
    np.testing.assert_allclose(theta.u, u, atol=2e-3)


def test_it_finds_the_right_handed_equivalent_of_a_mirrored_sensor():
    D, u = np.diag([1.0, 1.0, -1.0]), np.array([0.1, 0.2, np.sqrt(0.95)])
    theta = initialise(exact(D, np.zeros(3), u), np.zeros(3))
    np.testing.assert_allclose(theta.D, -D, atol=2e-3)
    np.testing.assert_allclose(theta.u, -u, atol=2e-3)


@pytest.mark.parametrize("first", [150, 250, 350])
def test_a_gap_in_which_the_board_turned_does_no_harm(first):
    D, b_a = np.array([[1.3, 0.1, -0.2], [0.3, 0.6, 0.1], [0.0, -0.2, 0.9]]), np.array([1.0, -0.5, 0.3])
    problem = exact(D, b_a, np.array([0.0, 0.0, 1.0]), lost=np.arange(100 + first, 150 + first))
    theta = initialise(problem, np.zeros(3))
    np.testing.assert_allclose(theta.D, D, atol=0.02)
    np.testing.assert_allclose(theta.b_a, b_a, atol=0.1)
    np.testing.assert_allclose(theta.u, [0, 0, 1], atol=0.02)


@pytest.mark.parametrize("begin", [initialise, linear], ids=["the best of all", "a start that does not settle"])
def test_many_gaps_do_not_lead_to_a_wrong_optimum(begin, hand, pick, monkeypatch):
    monkeypatch.setattr("mpucal.calibration.hand.initialise", begin)
    simulated, rng = hand(4, "pose12"), np.random.default_rng(4)
    t = simulated.recording.t - simulated.recording.t[0]
    kept, at = np.ones(len(t), bool), 10.5
    while at < t[-1] - 1.0:
        last = at + rng.uniform(0.1, 0.5)
        kept &= (t < at) | (t >= last)
        at = last + rng.uniform(0.5, 5.0)
    found = calibrate(replace(pick(simulated.recording, kept), flat=simulated.recording.flat))
    assert found.fit["converged"]
    np.testing.assert_array_less(np.abs(found.b_a - simulated.truth.b_a), 4.0 * found.b_a_std)
