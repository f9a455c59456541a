"""Hypotheses on a recording: found in recordings of sensors that changed, and not in others, and their evidence."""

import re
from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate, estimate, hypotheses
from mpucal.calibration.hypotheses import (
    HYPOTHESES,
    LARGEST,
    SURE,
    VARIANCES,
    Hypothesis,
    _explain,
    _Groups,
    _without,
    explain,
    rank,
)
from mpucal.calibration.parameters import PLACES
from mpucal.calibration.parts import Parts
from mpucal.calibration.quality import judge
from mpucal.calibration.uncertainty import UncertaintyClaim, propagate
from mpucal.data import STANDARD_GRAVITY_MPS2
from tools.lab.families import of_seed
from tools.lab.judge import judged, sph_rms

G = 9.82


@pytest.mark.parametrize("motion", ["continuous", "wobble100", "pose12", "pose7", "calm jerks"])
def test_a_sensor_that_stays_the_same_did_not_change(hand, motion):
    evidence, _ = estimate(hand(1, motion).recording, "auto", G)
    assert evidence.claim.change is None
    if motion in ("continuous", "pose12", "pose7"):
        error = judge(evidence)["error_std"]
        assert error["decided_by"] == "model"
        assert error["model"] <= error["rms"] < 1.1 * error["model"]


@pytest.mark.parametrize("seed", [3, 7, 10])
def test_long_rests_of_a_trembling_hand_show_no_change(hand, seed):
    """Hold eight orientations for 8 s each: D could take nearly all that a change would do to so few."""
    run = hand(seed, "pose8 slow", tremble=True)
    calibration = calibrate(run.recording, "auto", G)
    assert calibration.verdict == "good"
    assert judged(calibration, (run.truth.D, run.truth.b_a)).farthest < 3.0


@pytest.mark.parametrize("what", ["bias", "scale"])
def test_each_element_holds_what_a_changed_sensor_was_and_became(hand, what):
    """Change a sensor in the middle of its recording, and compare with its parameters (12,) before and after."""
    simulated = hand(1, "pose12")
    recording, (D, b) = simulated.recording, (simulated.truth.D, simulated.truth.b_a)
    after = {"bias": (D, b + np.array([0.03, -0.05, 0.03])), "scale": (np.diag([1.004, 0.998, 1.002]) @ D, b)}[what]
    at = len(recording) // 2
    acc = recording.acc.copy()
    acc[at:] = (acc[at:] - b) @ (after[0] @ np.linalg.inv(D)).T + after[1]
    calibration = calibrate(replace(recording, acc=acc), "auto", G)
    assert calibration.verdict == "usable"
    (said,) = calibration.quality["reasons"]
    assert said["code"] == ("zero_moved" if what == "bias" else "inconsistent")
    if what == "bias":
        begin, end = map(float, re.findall(r"[\d.]+", said["message"].split(";")[0])[-2:])
        assert begin - 3.0 < recording.t[at] - recording.t[0] < end + 3.0
    estimated, std = (
        np.append(D, b) for D, b in ((calibration.D, calibration.b_a), (calibration.D_std, calibration.b_a_std))
    )
    for truth in ((D, b), after):
        assert np.abs((estimated - np.append(*truth)) / std).max() < 3.0


@pytest.mark.parametrize("how", ["steps", "drifts"])
def test_a_gyroscopes_bias_that_steps_or_drifts_is_followed(hand, how):
    made = hand(2, "continuous")
    recording = made.recording
    share = recording.t / recording.t[-1] if how == "drifts" else np.arange(len(recording)) >= len(recording) * 6 // 10
    moved = share[:, None] * np.radians({"drifts": [0.3, -0.4, 0.0], "steps": [2.0, 1.0, -2.0]}[how])
    found, still = (calibrate(r, gravity=G) for r in (replace(recording, gyr=recording.gyr + moved), recording))
    assert found.verdict != "refused"
    assert judged(found, (made.truth.D, made.truth.b_a)).farthest < 3.0
    times = {"drifts": 1.5, "steps": 4.0}[how]  # what is left of a large step looks like a slip, which the claim holds
    assert found.quality["error_std"]["rms"] < times * still.quality["error_std"]["rms"]


@pytest.mark.parametrize("seed", [7, 28])
def test_a_step_of_the_gyroscopes_bias_between_rests_leaves_the_claim_true(seed):
    assert not of_seed(("gyro step poses", seed)).false


@pytest.mark.parametrize(("seed", "motion"), [(3, "continuous"), (1, "pose12"), (5, "pose12")])
def test_a_nonlinear_sensor_is_claimed_by_its_readings(hand, seed, motion):
    """A square of 2.5 mg at 1 g, less the linear sensor that is nearest to it; it is no bias that moved."""
    made = hand(seed, motion)
    bent = made.recording.acc + 0.025 * ((made.recording.acc / G) ** 2 - 1.0 / 3.0)
    fit = calibrate(replace(made.recording, acc=bent), gravity=G)
    assert {reason["code"] for reason in fit.quality["reasons"]} <= {"few_orientations"}
    assert sph_rms(made.truth, fit.D, fit.b_a) < 3.0 * fit.quality["error_std"]["rms"]
    assert judged(fit, (made.truth.D, made.truth.b_a)).farthest < 4.0


# ---- the evidence, compared with the joint Gaussian


# m/s^2 without b_a, of the flat segment and up to 48 parts
READINGS = G * (np.array([0.0, 0.0, 1.0]) + np.random.default_rng(5).uniform(-0.5, 0.5, (49, 3)))


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
    parts = Parts(gradient, np.einsum("kmp,kmq->kpq", A, A), H, left, t, t + 1.0, READINGS[: 1 + k])
    return A, y, parts


@pytest.mark.parametrize("shape", ["walk", "each", "step", "pulse", "reading"])
def test_evidence_distance_and_variance_are_those_of_the_joint_gaussian(shape, monkeypatch):
    """Compare with the posteriors of theta and x together, for all variances and, of a step or pulse, all times."""
    A, y, parts = linear_parts()
    k, m, p = A.shape
    (explained,) = _explain([Hypothesis("accelerometer", shape)], _Groups.of(parts, 5), parts, np.eye(3))
    windows = [[[float(i <= j < i + width)] for j in range(k + 1)] for width in (1, 2, 3) for i in range(k + 1)]
    u = READINGS[: 1 + k] / STANDARD_GRAVITY_MPS2
    # weights of the numbers in the flat segment and in each part, by axis
    shapes = {
        "walk": [np.vstack([np.zeros(k), np.tri(k)])[:, :, None]],
        "each": [np.vstack([np.zeros(k), np.eye(k)])[:, :, None]],
        "step": [(np.arange(k + 1) >= i)[:, None, None] for i in range(2, k + 1)]
        + [np.append(0.0, (np.arange(k) + 0.5) / 4.5)[:, None, None]],
        "pulse": [np.array(window)[:, :, None] for window in windows],
        "reading": [np.stack([u**2 - 1.0 / 3.0, u**3 - 3.0 / 5.0 * u], axis=1)],
    }[shape]
    design, y = A.reshape(k * m, p), y.ravel()
    B = np.zeros((p, 3))
    B[PLACES["b_a"]] = np.eye(3)
    minimum = np.linalg.solve(parts.H, design.T @ y)
    logs, squares, unseen = [], [], []
    for of in (each * np.ones(3) for each in shapes):
        for q in LARGEST["accelerometer"] ** 2 * VARIANCES:
            # by the normal equations of x and the parameters in the flat segment, which is in no part
            of_x = np.einsum("ksi,kmi->kmsi", of[1:] - of[0], A[:, :, PLACES["b_a"]]).reshape(k * m, -1)
            both = np.hstack([design, of_x])
            covariance = np.linalg.inv(both.T @ both + np.diag(np.r_[np.ones(p), np.full(of_x.shape[1], 1.0 / q)]))
            mean = covariance @ both.T @ y
            # a changed sensor is another one in each group; what a pulse or a curve adds is not the sensor's
            of_groups = of[1:] if shape in ("step", "walk") else -of[:1]
            to = np.array([np.hstack([np.eye(p), *(B * numbers for numbers in of_group)]) for of_group in of_groups])
            variance = np.diagonal(to @ covariance @ to.swapaxes(1, 2), axis1=1, axis2=2)
            squares.append(variance - np.diag(parts.covariance) + (to @ mean - minimum) ** 2)
            of_flat = to[0] if shape in ("pulse", "reading") else np.eye(*to[0].shape)
            unseen.append(of_flat @ covariance @ of_flat.T - parts.covariance)
            marginal = np.eye(k * m) + design @ design.T + q * of_x @ of_x.T
            logs.append(-0.5 * (np.linalg.slogdet(marginal)[1] + y @ np.linalg.solve(marginal, y)))
    without = np.eye(k * m) + design @ design.T
    none = -0.5 * (np.linalg.slogdet(without)[1] + y @ np.linalg.solve(without, y))
    assert explained.evidence == pytest.approx(np.logaddexp.reduce(logs) - none - np.log(len(logs)), rel=1e-6, abs=1e-9)
    removed = hypotheses.unseen_changes([explained, explained._replace(q=0.0)], parts, np.eye(3), False)
    np.testing.assert_allclose(removed, unseen[int(np.argmax(logs))], rtol=1e-6, atol=1e-12)
    if shape == "reading":  # a nonlinearity of a known size adds as much
        monkeypatch.setattr(hypotheses, "NONLINEARITY_MPS2", LARGEST["accelerometer"])
        np.testing.assert_allclose(hypotheses.nonlinearity(parts, np.eye(3)), unseen[-1], rtol=1e-6, atol=1e-12)
    weights = np.exp(np.array(logs) - max(logs))
    expected = np.tensordot(weights, squares, 1) / weights.sum()
    np.testing.assert_allclose(explained.aways**2, expected, rtol=1e-6)
    unlikely = explained._replace(is_possible=True, weight=0.4).away ** 2
    np.testing.assert_allclose(unlikely, expected.mean(axis=0), rtol=1e-6)
    changed = explained.hypothesis.kind == "change"
    likely = explained._replace(is_possible=True, weight=0.6).away ** 2
    np.testing.assert_allclose(likely, expected.max(axis=0) if changed else expected.mean(axis=0), rtol=1e-6)


def test_faces_of_a_cube_do_not_show_a_cube_of_the_readings():
    """Measure D and b_a on six faces, in known directions: the cube passes for a scale factor, the square is seen."""
    faces = STANDARD_GRAVITY_MPS2 * np.vstack([np.eye(3), -np.eye(3)])
    A = np.array([np.hstack([np.kron(np.eye(3), s), np.eye(3)]) for s in faces]) / 1e-5
    fisher = np.einsum("kmp,kmq->kpq", A, A)
    k, p = len(A), A.shape[2]
    t, gradient = np.arange(k, dtype=float), np.zeros((k, p))
    parts = Parts(gradient, fisher, fisher.sum(0) + np.eye(p), np.zeros(p), t, t + 1.0, np.vstack([faces[2], faces]))
    std = np.sqrt(np.diag(hypotheses.nonlinearity(parts, np.eye(3))))
    cube = (1.0 - 3.0 / 5.0) * hypotheses.NONLINEARITY_MPS2 / STANDARD_GRAVITY_MPS2
    np.testing.assert_allclose(std[[0, 4, 8]], cube, rtol=1e-3)
    assert np.delete(std, [0, 4, 8]).max() < 0.02 * cube


def test_all_hypotheses_and_nothing_are_weighed_against_each_other():
    found = rank(linear_parts()[-1], np.eye(3))
    assert {each.hypothesis for each in found} == set(HYPOTHESES)
    priors = np.array([each.hypothesis.prior for each in found])
    odds = np.exp([each.evidence for each in found]) * priors / sum(each.prior for each in HYPOTHESES)
    np.testing.assert_allclose([each.weight for each in found], odds / (1.0 + odds.sum()))


def test_each_cause_of_what_surely_happened_is_held():
    _, _, parts = linear_parts()
    for scale, surely in ((0.1, False), (2.0, True)):
        found = rank(replace(parts, gradient=scale * parts.gradient, left=scale * parts.left), np.eye(3))
        squares = np.array([each.away**2 for each in found])
        weights = np.array([each.weight for each in found])
        assert (1.0 - weights.sum() < 1.0 / SURE) == surely
        mean, held = weights @ squares, squares[SURE * weights > weights.max()]
        expected = np.maximum(mean, held.max(axis=0)) if surely else mean
        claim = UncertaintyClaim(parts.covariance, 1.0, 1.0, found)
        np.testing.assert_allclose(np.diag(claim.widen() - parts.covariance), expected, rtol=1e-9)
        assert not surely or (len(held) > 1 and (expected > mean).any())


def test_a_claim_that_nothing_else_explains_is_the_models():
    _, _, parts = linear_parts()
    np.testing.assert_allclose(UncertaintyClaim(parts.covariance, 1.0, 2.0).widen(), 4.0 * parts.covariance)


def test_a_cause_that_explains_nearly_as_much_is_held_though_odds_exclude_it():
    _, _, parts = linear_parts()
    found = rank(replace(parts, gradient=8.0 * parts.gradient, left=8.0 * parts.left), np.eye(3))
    most = found[0].log_share
    nearly = [each for each in found if each.log_share > 0.75 * most and SURE * each.weight < found[0].weight]
    held = np.diag(UncertaintyClaim(parts.covariance, 1.0, 1.0, found).widen())
    assert nearly and all((held > each.away**2).all() for each in nearly)
    far = [each for each in found if each.log_share < 0.65 * most]
    assert far and any((held < each.away**2).any() for each in far)


def test_an_accepted_hypothesis_is_taken_out_of_the_scores():
    A, y, parts = linear_parts()
    theta = parts.left - parts.gradient.sum(0)  # by the unit prior
    (step,) = _explain([Hypothesis("accelerometer", "step")], _Groups.of(parts, 5), parts, np.eye(3))
    there, without = theta + step.shift, _without(parts, step)
    gradient = -np.einsum("kmp,km->kp", A, y - np.einsum("kmp,kp->km", A, there[1:]))
    np.testing.assert_allclose(without.gradient, gradient, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(without.left, gradient.sum(0) + there[0], rtol=1e-9, atol=1e-9)


def test_a_small_drift_is_found_beside_a_large_one():
    """Drift of the gyroscope's bias by 3,000 standard deviations of a part, and of the accelerometer's by 300."""
    rng = np.random.default_rng(4)
    k, p, m = 48, 18, 12
    A = rng.standard_normal((k, m, p))
    delta = np.zeros((k, p))
    drift = np.arange(k)[:, None] / k
    delta[:, PLACES["b_omega"]], delta[:, PLACES["b_a"]] = 0.03 * drift, 0.003 * drift[::-1]
    scale = 1e5
    H_k = scale**2 * np.einsum("kmp,kmq->kpq", A, A)
    score = np.einsum("kpq,kq->kp", H_k, delta) + scale * np.einsum("kmp,km->kp", A, rng.standard_normal((k, m)))
    H = H_k.sum(0) + np.eye(p)
    gradient = np.einsum("kpq,q->kp", H_k, np.linalg.solve(H, score.sum(0))) - score
    t = np.arange(k, dtype=float)
    parts = Parts(gradient, H_k, H, gradient.sum(0), t, t + 1.0, READINGS[: 1 + k])
    first, second = explain(parts, np.eye(3), rank(parts, np.eye(3)))[:2]
    assert (first.hypothesis.what, second.hypothesis.what) == ("gyroscope", "accelerometer")
    assert min(first.weight, second.weight) > 0.99
    assert second.is_sure


def test_the_uncertainty_is_the_spread_of_calibrated_measurements():
    D = np.array([[1.1, 0.05, -0.1], [0.2, 0.8, 0.0], [-0.05, 0.1, 0.9]])
    A = 0.01 * np.random.default_rng(0).standard_normal((12, 12))
    C = A @ A.T / 12
    rng = np.random.default_rng(1)
    s = rng.standard_normal((4000, 3))
    s *= G / np.linalg.norm(s, axis=1, keepdims=True)
    drawn = rng.multivariate_normal(np.append(D, np.zeros(3)), C, 4000)
    calibrated = np.linalg.solve(drawn[:, :9].reshape(-1, 3, 3), (s @ D.T - drawn[:, 9:])[..., None])[..., 0]
    known, length = propagate(D, C, G), np.linalg.norm(calibrated, axis=1)
    assert known.rms_mps2 == pytest.approx(np.sqrt(((calibrated - s) ** 2).sum(1).mean()), rel=0.03)
    assert known.magnitude_mps2 == pytest.approx(np.sqrt(((length - G) ** 2).mean()), rel=0.03)
    angle = np.arccos((calibrated * s).sum(1) / length / G)
    assert known.direction_rad == pytest.approx(np.sqrt((angle**2).mean()), rel=0.03)
