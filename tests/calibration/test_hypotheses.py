"""Hypotheses on a recording: found in recordings of sensors that changed, and not in others, and their evidence."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate, estimate
from mpucal.calibration.hypotheses import (
    HYPOTHESES,
    LARGEST,
    VARIANCES,
    Explanation,
    Hypothesis,
    _explain,
    _Groups,
    explain,
)
from mpucal.calibration.parameters import PLACES
from mpucal.calibration.parts import Parts
from mpucal.calibration.rotation import rotation
from mpucal.calibration.uncertainty import claim_uncertainty
from tools.lab.judge import judged, sph_rms

G = 9.82


def likeliest(recording):
    evidence, _ = estimate(recording, "auto", G)
    return explain(evidence.fit.parts, evidence.fit.D)[0]


@pytest.mark.parametrize("motion", ["continuous", "wobble30", "wobble100", "pose12", "calm jerks"])
def test_a_sensor_that_stays_the_same_did_not_change(hand, motion):
    evidence, _ = estimate(hand(1, motion).recording, "auto", G)
    assert evidence.claim.change is None


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_a_step_of_the_bias_is_found_where_it_was(hand, share):
    recording = hand(1, "pose12").recording
    at = 2000 + int(share * (len(recording) - 2000))
    acc = recording.acc.copy()
    acc[at:] += [0.1, -0.1, 0.1]
    step = likeliest(replace(recording, acc=acc))
    assert step.hypothesis == Hypothesis("accelerometer", "step")
    assert step.size == pytest.approx(0.17, rel=0.5)
    begin, end = step.span
    flat_s = 10.0
    assert flat_s + begin - 3.0 < recording.t[at] < flat_s + end + 3.0


def test_a_mount_that_slips_is_told_from_a_bias(hand):
    recording = hand(1, "continuous").recording
    at = len(recording) * 6 // 10
    acc = recording.acc.copy()
    acc[at:] = acc[at:] @ rotation(np.radians([3.0, -5.0, 2.0])).T
    assert likeliest(replace(recording, acc=acc)).hypothesis.what == "mount"


def changed(hand, what):
    """Return a recording of a sensor that changed at 45 % of it, and its parameters (12,) before and after."""
    simulated = hand(2, "pose12")
    recording, (D, b) = simulated.recording, (simulated.truth.D, simulated.truth.b_a)
    after = {"bias": (D, b + np.array([0.04, -0.02, 0.03])), "scale": (np.diag([1.004, 0.998, 1.002]) @ D, b)}[what]
    at = len(recording) * 45 // 100
    acc = recording.acc.copy()
    acc[at:] = (acc[at:] - b) @ (after[0] @ np.linalg.inv(D)).T + after[1]
    return replace(recording, acc=acc), [np.append(D, b) for D, b in ((D, b), after)]


@pytest.mark.parametrize("what", ["bias", "scale"])
def test_each_element_holds_what_a_changed_sensor_was_and_became(hand, what):
    recording, truths = changed(hand, what)
    calibration = calibrate(recording, "auto", G)
    assert calibration.verdict == "usable"
    estimated, std = (
        np.append(D, b) for D, b in ((calibration.D, calibration.b_a), (calibration.D_std, calibration.b_a_std))
    )
    for truth in truths:
        assert np.abs((estimated - truth) / std).max() < 3.0


def linear_parts():
    """Return A (k, m, p), y (k, m) of parts that measure theta linearly with unit noise and prior, and the parts."""
    rng = np.random.default_rng(3)
    k, p, m = 5, 18, 12
    A = rng.standard_normal((k, m, p))
    y = rng.standard_normal((k, m))
    y[:, 0] += np.linspace(0.0, 4.0, k)
    # With a prior on theta, which H includes, the density of y exists.
    prior = np.eye(p)
    H = prior + np.einsum("kmp,kmq->pq", A, A)
    # A minimiser may stop short of the minimum.
    theta = np.linalg.solve(H, np.einsum("kmp,km->p", A, y)) + 0.1 * rng.standard_normal(p)
    gradient = -np.einsum("kmp,km->kp", A, y - A @ theta)
    t = np.arange(k, dtype=float)
    left = gradient.sum(0) + prior @ theta
    return A, y, Parts(gradient, np.einsum("kmp,kmq->kpq", A, A), H, left, t, t + 1.0, np.zeros(k, np.intp))


@pytest.mark.parametrize("shape", ["walk", "each", "step", "pulse"])
def test_the_evidence_is_that_of_the_joint_gaussian(shape):
    """Compare with the mean of SciPy's densities over all variances and, of a step or pulse, all times."""
    from scipy.stats import multivariate_normal  # slow to import

    A, y, parts = linear_parts()
    k, m, p = A.shape
    hypothesis = Hypothesis("accelerometer", shape)
    told = _explain(hypothesis, _Groups.of(parts, 5), parts, np.eye(3))
    flat = np.zeros((1, k + 1))
    flat[0, 0] = 1.0
    windows = [[float(i <= j < i + width) for j in range(k + 1)] for width in (1, 2, 3) for i in range(k + 1)]
    shapes = {
        "walk": [np.tri(k)],
        "each": [np.eye(k)],
        "step": [np.array([[float(j >= i)] for j in range(k)]) for i in range(1, k)]
        + [(np.arange(k) + 0.5)[:, None] / 4.5],
        # theta is what the flat segment has not, if the pulse is there
        "pulse": [np.array([[inside - window[0]] for inside in window[1:]]) for window in windows],
    }[shape]
    design = A.reshape(k * m, p)
    without = np.eye(k * m) + design @ design.T
    blocks = A[:, :, PLACES["b_a"]]

    def density(of, q):
        x_to_y = np.einsum("ks,kmi->kmsi", of, blocks).reshape(k * m, -1)
        return multivariate_normal(cov=without + q * x_to_y @ x_to_y.T).logpdf(y.ravel())

    none = multivariate_normal(cov=without).logpdf(y.ravel())
    ratios = [density(of, q) - none for of in shapes for q in LARGEST["accelerometer"] ** 2 * VARIANCES]
    assert told.evidence == pytest.approx(np.logaddexp.reduce(ratios) - np.log(len(ratios)), rel=1e-6, abs=1e-9)


def test_the_estimate_is_as_far_away_as_the_other_posterior_says():
    """Compare with theta where each part has a bias of its own, by the joint normal equations."""
    A, y, parts = linear_parts()
    k, m, p = A.shape
    told = _explain(Hypothesis("accelerometer", "each"), _Groups.of(parts, 5), parts, np.eye(3))
    design = A.reshape(k * m, p)
    of_x = np.einsum("ks,kmi->kmsi", np.eye(k), A[:, :, PLACES["b_a"]]).reshape(k * m, -1)
    both = np.hstack([design, of_x])
    estimate_ = np.linalg.solve(parts.H, design.T @ y.ravel())
    logs, squares = [], []
    for q in LARGEST["accelerometer"] ** 2 * VARIANCES:
        H = both.T @ both + np.diag(np.append(np.ones(p), np.full(3 * k, 1.0 / q)))
        mean, covariance = np.linalg.solve(H, both.T @ y.ravel()), np.linalg.inv(H)
        squares.append(np.diag(covariance)[:p] - np.diag(parts.covariance) + (mean[:p] - estimate_) ** 2)
        marginal = np.eye(k * m) + design @ design.T + q * of_x @ of_x.T
        logs.append(-0.5 * (np.linalg.slogdet(marginal)[1] + y.ravel() @ np.linalg.solve(marginal, y.ravel())))
    weights = np.exp(np.array(logs) - max(logs))
    np.testing.assert_allclose(told.away**2, weights @ squares / weights.sum(), rtol=1e-6)


def test_the_variance_with_a_walk_removed_is_that_of_the_joint_gaussian():
    A, y, parts = linear_parts()
    k, m, p = A.shape
    told = _explain(Hypothesis("gyroscope", "walk"), _Groups.of(parts, 5), parts, np.eye(3))
    design, y = A.reshape(k * m, p), y.ravel()
    walked = np.einsum("ks,kmi->kmsi", np.tri(k), A[:, :, PLACES["b_omega"]]).reshape(k * m, -1)
    logs, variances = [], []
    for q in LARGEST["gyroscope"] ** 2 * VARIANCES:
        noise = np.eye(k * m) + q * walked @ walked.T
        variances.append(np.diag(np.linalg.inv(np.eye(p) + design.T @ np.linalg.solve(noise, design))))
        marginal = noise + design @ design.T
        logs.append(-0.5 * (np.linalg.slogdet(marginal)[1] + y @ np.linalg.solve(marginal, y)))
    expected = variances[int(np.argmax(logs))] / np.diag(parts.covariance)
    np.testing.assert_allclose(1.0 + told.freed, expected, rtol=1e-6)


def test_all_hypotheses_and_nothing_are_weighed_against_each_other():
    _, _, parts = linear_parts()
    found = explain(parts, np.eye(3))
    priors = np.array([each.hypothesis.prior for each in found])
    odds = np.exp([each.evidence for each in found]) * priors / sum(each.prior for each in HYPOTHESES)
    np.testing.assert_allclose([each.weight for each in found], odds / (1.0 + odds.sum()))


def test_a_walk_is_drawn_straight_from_where_the_turning_begins():
    delta, none = np.array([[0.0, 0.0, 0.2], [0.0, 0.0, 0.4]]), np.zeros(15)
    hypothesis, times = Hypothesis("gyroscope", "walk"), (np.array([0.0, 2.0]), np.array([2.0, 4.0]))
    walk = Explanation(hypothesis, 30.0, delta, *times, none, none, none)
    np.testing.assert_allclose(walk.at(np.array([0.0, 0.5, 1.0, 2.0, 9.0]))[:, 2], [0.0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize("drift_dps", [0.1, 0.5])
def test_a_steady_drift_of_the_gyroscope_is_removed(hand, drift_dps):
    made = hand(3, "continuous")
    recording = made.recording
    drift = np.radians(drift_dps) * (recording.t / recording.t[-1])[:, None] * np.array([0.6, -0.8, 0.0])
    found = calibrate(replace(recording, gyr=recording.gyr + drift), gravity=G)
    assert judged(found, (made.truth.D, made.truth.b_a)).farthest < 3.0
    still = calibrate(recording, gravity=G)
    assert found.quality["error_std"]["rms"] < 1.5 * still.quality["error_std"]["rms"]


@pytest.mark.parametrize("motion", ["continuous", "pose12", "pose7"])
def test_where_the_model_holds_the_claim_is_the_models(hand, motion):
    for seed in range(2):
        evidence, _ = estimate(hand(seed, motion).recording, "auto", G)
        assert evidence.claim.decided_by == "model"
        assert evidence.uncertainty.rms_mps2 < 1.1 * evidence.claim.floored


@pytest.mark.parametrize("seed", [3, 4])
def test_a_nonlinear_sensor_is_claimed_by_its_sides(hand, seed):
    made = hand(seed, "continuous")
    s = made.recording.acc
    bent = replace(made.recording, acc=s + 0.005 * s**2 / (2.0 * G))
    fit = calibrate(bent, gravity=G)
    assert sph_rms(made.truth, fit.D, fit.b_a) < 3.0 * fit.quality["error_std"]["rms"]
    assert judged(fit, (made.truth.D, made.truth.b_a)).farthest < 4.0


def test_with_too_few_sides_to_compare_the_models_uncertainty_is_doubled(hand):
    fit = estimate(hand(1, "continuous").recording, "hand", G)[0].fit
    alike = np.zeros_like(fit.parts.side)
    one_side = replace(fit, parts=replace(fit.parts, side=alike))
    sides = [claim_uncertainty(of, G, [], np.zeros(12)) for of in (fit, one_side)]
    assert sides[1].floored == 2.0 * sides[0].floored
    assert {each.hypothesis for each in explain(one_side.parts, fit.D)} == {
        each for each in HYPOTHESES if not each.by_side
    }


def test_the_document_names_what_set_the_uncertainty(hand):
    made = hand(1, "pose12")
    error = calibrate(made.recording, gravity=G).quality["error_std"]
    assert error["decided_by"] == "model"
    parts = [error[name] for name in ("time", "side", "change")]
    assert error["model"] <= error["rms"] < np.hypot(error["model"], np.sum(parts))
