"""Changes of the sensor's bias, scale factors or mount, in recordings with one and without, and their likelihoods."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate, estimate
from mpucal.calibration.changes import STEP_SD, VARIANCES, Change, _step, _walk, find_changes
from mpucal.calibration.parameters import PLACES
from mpucal.calibration.parts import Parts
from mpucal.calibration.rotation import rotation

G = 9.82


def change_in(recording):
    evidence, _ = estimate(recording, "auto", G)
    return find_changes(evidence.fit.parts, evidence.fit.D)[0]


@pytest.mark.parametrize("motion", ["continuous", "wobble30", "wobble100", "pose12", "calm jerks"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_sensor_that_stays_the_same_did_not_change(hand, motion, seed):
    evidence, _ = estimate(hand(seed, motion).recording, "auto", G)
    assert evidence.claim.change is None


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_a_step_of_the_bias_is_found_where_it_was(hand, share):
    recording = hand(1, "pose12").recording
    at = 2000 + int(share * (len(recording) - 2000))
    acc = recording.acc.copy()
    acc[at:] += [0.1, -0.1, 0.1]
    walk = change_in(replace(recording, acc=acc))
    assert walk.what == "accelerometer"
    assert walk.size == pytest.approx(0.17, rel=0.5)
    begin, end = walk.steepest
    flat_s = 10.0
    assert flat_s + begin - 3.0 < recording.t[at] < flat_s + end + 3.0


def test_a_mount_that_slips_is_told_from_a_bias(hand):
    recording = hand(1, "continuous").recording
    at = len(recording) * 6 // 10
    acc = recording.acc.copy()
    acc[at:] = acc[at:] @ rotation(np.radians([3.0, -5.0, 2.0])).T
    assert change_in(replace(recording, acc=acc)).what == "mount"


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


def test_the_likelihood_of_a_walk_is_that_of_the_joint_gaussian():
    """Compare 2 log p(q)/p(0) with SciPy's density."""
    from scipy.stats import multivariate_normal  # slow to import

    A, y, parts = linear_parts()
    k, m, p = A.shape
    walk = _walk("gyroscope", parts, np.eye(3), *parts.grouped(np.arange(k)), np.arange(k) + 0.5)

    def density(q):
        blocks = A[:, :, PLACES["b_omega"]]
        covariance = np.eye(k * m) + A.reshape(k * m, p) @ A.reshape(k * m, p).T
        steps = np.array([[min(i, j) + 1.0 for j in range(k)] for i in range(k)])
        walked = np.block([[steps[i, j] * blocks[i] @ blocks[j].T for j in range(k)] for i in range(k)])
        return multivariate_normal(cov=covariance + q * walked).logpdf(y.ravel())

    gains = [2.0 * (density(q) - density(0.0)) for q in VARIANCES["gyroscope"]]
    assert walk.gain == pytest.approx(max(gains), rel=1e-6, abs=1e-9)


def test_the_likelihood_of_a_step_is_that_of_least_squares():
    """Compare with the sums of squares that NumPy's least squares leave, with and without each step or drift."""
    A, y, parts = linear_parts()
    k, m, p = A.shape
    middles = np.arange(k) + 0.5
    step = _step("accelerometer", parts, np.eye(3), *parts.grouped(np.arange(k)), middles)

    def solve(shape):
        measured = np.hstack([A.reshape(k * m, p), (shape[:, None, None] * A[:, :, PLACES["b_a"]]).reshape(k * m, 3)])
        J = np.vstack([measured, np.diag(np.append(np.ones(p), np.full(3, 1.0 / STEP_SD["accelerometer"])))])
        of_y = np.append(y, np.zeros(p + 3))
        x = np.linalg.lstsq(J, of_y)[0]
        return np.sum((of_y - J @ x) ** 2), x

    shapes = [*(1.0 * (np.arange(k) >= i) for i in range(1, k)), middles / middles[-1]]
    least, best = min(solve(shape)[0] for shape in shapes), min(shapes, key=lambda shape: solve(shape)[0])
    tries = 2.0 * np.log(len(STEP_SD) * len(shapes))
    assert step.gain == pytest.approx(solve(np.zeros(k))[0] - least - tries, rel=1e-6)
    np.testing.assert_allclose(step.delta, np.outer(best, solve(best)[1][p:]), rtol=1e-6)


def test_a_walk_is_drawn_straight_from_where_the_turning_begins():
    delta = np.array([[0.0, 0.0, 0.2], [0.0, 0.0, 0.4]])
    walk = Change("gyroscope", 30.0, 30.0, 1e-8, delta, np.array([1.0, 3.0]), np.zeros(15))
    np.testing.assert_allclose(walk.at(np.array([0.0, 0.5, 1.0, 2.0, 9.0]))[:, 2], [0.0, 0.1, 0.2, 0.3, 0.4])
