"""Jackknife by one Newton step, compared with fits without a part, and claims where the model is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate, estimate
from mpucal.calibration.initial_estimate import initialise
from mpucal.calibration.jackknife import _moved, jackknife
from mpucal.calibration.likelihood import evaluate, part_scores
from mpucal.calibration.parameters import ACCEL, HAND
from mpucal.calibration.parts import Parts
from mpucal.calibration.preprocessing import preprocess
from mpucal.calibration.problem import Problem, Series
from mpucal.calibration.uncertainty import claim_uncertainty
from mpucal.rests.flat import find_flat, flat_statistics
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import paper_scenario

G = 9.82


def in_hand(hand):
    recording = hand(1, "continuous").recording
    prepared = preprocess(recording, find_flat(recording), G)
    return prepared.white(0.3), initialise(prepared.problem, prepared.flat.b_omega)


def in_place(_):
    recording = paper_scenario(1, rate_hz=50).recording
    flat = flat_statistics(recording, find_flat(recording))
    problem = Problem(Series.after(recording, flat), flat, G)
    return problem, initialise(problem, flat.b_omega)


@pytest.mark.parametrize(("made", "parameters", "block"), [(in_place, ACCEL, 8), (in_hand, HAND, 16)])
def test_the_parts_scores_sum_to_the_whole(hand, made, parameters, block):
    problem, theta = made(hand)
    n = len(problem.series)
    cut = evaluate(problem, theta, parameters, np.array([n // 3, n // 2, n]))
    scores = part_scores(problem, theta, parameters, cut.to_ends)
    begin, whole = evaluate(problem.first(0), theta, parameters), evaluate(problem, theta, parameters)
    np.testing.assert_allclose(scores.gradient.sum(0) + begin.gradient, whole.gradient, rtol=1e-9)
    np.testing.assert_allclose(scores.fisher.sum(0) + scores.flat.fisher, whole.fisher, rtol=1e-9, atol=1e-6)
    # The kernel sums up to whole blocks of steps, of which the flat mean is the first.
    end = (n // 3 // block + 1) * block - 1
    first = evaluate(problem.first(end), theta, parameters)
    np.testing.assert_allclose(scores.gradient[0] + begin.gradient, first.gradient, rtol=1e-9)


@pytest.mark.parametrize("motion", ["continuous", "pose12"])
def test_where_the_model_holds_the_claim_is_the_models(hand, motion):
    inflations = [estimate(hand(seed, motion).recording, "auto", G)[0].claim.inflation for seed in range(3)]
    assert np.median(inflations) < 1.3


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_a_side_that_no_other_can_replace_counts_little(hand, seed):
    claim = estimate(hand(seed, "pose7").recording, "auto", G)[0].claim
    # Leaving a side out moves the estimate by 15 times as much.
    assert 0.0 < claim.left_out.claim() < 5.0 * claim.model


def test_linear_measurements_without_a_part_are_fitted_exactly():
    """Compare with least squares: where the problem is quadratic, one Newton step gives the fit of the others."""
    rng = np.random.default_rng(0)
    k, m, p = 16, 20, 12
    A, y = rng.standard_normal((k, m, p)), rng.standard_normal((k, m))
    H = np.einsum("kmp,kmq->pq", A, A)
    theta = np.linalg.solve(H, np.einsum("kmp,km->p", A, y))
    gradient = -np.einsum("kmp,km->kp", A, y - A @ theta)
    fisher, left = np.einsum("kmp,kmq->kpq", A, A), gradient.sum(0)
    parts = Parts(gradient, fisher, H, left, np.arange(k), np.arange(1, k + 1), np.arange(k) % 6)
    groups = parts.by_time(8)
    left_out = [np.linalg.lstsq(A[groups != g].reshape(-1, p), y[groups != g].ravel(), rcond=None)[0] for g in range(8)]
    moved = np.array(left_out) - np.median(left_out, axis=0)
    d = np.sqrt(G**2 / 3.0 * np.sum(moved[:, :9] ** 2, axis=1) + np.sum(moved[:, 9:] ** 2, axis=1))
    assert jackknife(parts, np.eye(3), G).time == pytest.approx(1.2 * np.sqrt(7.0) * np.median(d), rel=1e-9)


def test_a_nonlinear_sensor_is_claimed_by_its_sides(hand):
    made = hand(3, "continuous")
    s = made.recording.acc
    bent = replace(made.recording, acc=s + 0.005 * s**2 / (2.0 * G))
    fit = calibrate(bent, gravity=G)
    assert sph_rms(made.truth, fit.D, fit.b_a) < 3.0 * fit.quality["error_std"]["rms"]


def test_with_too_few_sides_to_compare_the_models_uncertainty_is_doubled(hand):
    fit = estimate(hand(1, "continuous").recording, "hand", G)[0].fit
    alike = np.zeros_like(fit.parts.side)
    one_side = replace(fit, parts=replace(fit.parts, side=alike))
    sides = [claim_uncertainty(of, G, None, 0.0) for of in (fit, one_side)]
    assert sides[1].left_out.side == 0.0
    assert sides[1].floored == 2.0 * sides[0].floored


def test_the_document_names_the_estimate_that_set_the_uncertainty(hand):
    made = hand(1, "pose12")
    error = calibrate(made.recording, gravity=G).quality["error_std"]
    assert error["decided_by"] in ("model", "time", "side")
    assert error["rms"] == pytest.approx(
        max(error["model"], error["without_a_time"], error["without_a_side"]), rel=1e-6
    )


def test_leaving_out_the_only_group_that_determines_a_parameter_moves_it_without_bound():
    told = np.tile(np.eye(12), (4, 1, 1))
    told[2, 3, 3] = 0.0
    assert np.isinf(_moved(np.ones((4, 12)), told, np.eye(12))).all()
    assert np.isfinite(_moved(np.ones((4, 12)), told + np.eye(12), np.eye(12))).all()
