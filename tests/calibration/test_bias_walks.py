"""Walks of the sensor's bias or mount, in recordings with one and without, and an independent likelihood."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import estimate
from mpucal.calibration.bias_walks import STEPS, BiasWalk, _walk, find_walk
from mpucal.calibration.parts import Parts
from mpucal.calibration.rotation import rotation

G = 9.82


def walk_of(recording):
    evidence, _ = estimate(recording, "auto", G)
    return find_walk(evidence.fit.parts, evidence.fit.D)


@pytest.mark.parametrize("motion", ["continuous", "wobble30", "wobble100", "pose12", "calm jerks"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_sensor_that_stays_the_same_does_not_walk(hand, motion, seed):
    evidence, _ = estimate(hand(seed, motion).recording, "auto", G)
    assert evidence.claim.change is None


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_a_step_of_the_bias_is_found_where_it_was(hand, share):
    recording = hand(1, "pose12").recording
    at = 2000 + int(share * (len(recording) - 2000))
    acc = recording.acc.copy()
    acc[at:] += [0.1, -0.1, 0.1]
    walk = walk_of(replace(recording, acc=acc))
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
    assert walk_of(replace(recording, acc=acc)).what == "mount"


def test_the_likelihood_is_that_of_the_joint_gaussian():
    """Compare 2 log p(q)/p(0) with SciPy's density, for parts that measure theta + delta linearly."""
    from scipy.stats import multivariate_normal  # slow to import

    rng = np.random.default_rng(3)
    k, p, m = 5, 14, 9
    A = rng.standard_normal((k, m, p))
    y = rng.standard_normal((k, m))
    y[:, 0] += np.linspace(0.0, 4.0, k)
    # With a prior on theta, which H includes, the density of y exists.
    prior = np.eye(p)
    H = prior + np.einsum("kmp,kmq->pq", A, A)
    # A minimiser may stop short of the minimum.
    theta = np.linalg.solve(H, np.einsum("kmp,km->p", A, y)) + 0.1 * rng.standard_normal(p)
    gradient = -np.einsum("kmp,km->kp", A, y - A @ theta)
    parts = Parts(
        gradient,
        np.einsum("kmp,kmq->kpq", A, A),
        H,
        gradient.sum(0) + prior @ theta,
        np.arange(k, dtype=float),
        np.arange(1, k + 1, dtype=float),
        np.zeros(k, np.intp),
    )
    walk = _walk("accelerometer", parts, np.eye(3), *parts.grouped(np.arange(k)), np.arange(k) + 0.5)

    def density(q):
        B = np.zeros((p, 3))
        B[9:12] = np.eye(3)
        blocks = [A[i] @ B for i in range(k)]
        covariance = np.eye(k * m) + A.reshape(k * m, p) @ A.reshape(k * m, p).T
        steps = np.array([[min(i, j) + 1.0 for j in range(k)] for i in range(k)])
        walked = np.block([[steps[i, j] * blocks[i] @ blocks[j].T for j in range(k)] for i in range(k)])
        return multivariate_normal(cov=covariance + q * walked).logpdf(y.ravel())

    gains = [2.0 * (density(q) - density(0.0)) for q in STEPS["accelerometer"]]
    assert walk.gain == pytest.approx(max(gains), rel=1e-6, abs=1e-9)


def test_a_walk_is_drawn_straight_from_where_the_turning_begins():
    walk = BiasWalk("gyroscope", 30.0, 30.0, 1e-8, np.array([[0.0, 0.0, 0.2], [0.0, 0.0, 0.4]]), np.array([1.0, 3.0]))
    np.testing.assert_allclose(walk.at(np.array([0.0, 0.5, 1.0, 2.0, 9.0]))[:, 2], [0.0, 0.1, 0.2, 0.3, 0.4])
