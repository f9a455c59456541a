"""A change of the sensor midway, against recordings with one and without."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import change_detection, weigh
from mpucal.calibration.change_detection import likeliest_change
from mpucal.simulated.study.scenarios import paper_scenario

G = 9.82


def change_of(recording):
    evidence, _ = weigh(recording, "auto", G)
    return likeliest_change(evidence.recording, evidence.flat, evidence.fit, G)


@pytest.mark.parametrize("motion", ["continuous", "wobble30", "pose12", "calm jerks", "paper"])
def test_without_a_change_none_is_significant(hand, motion):
    recording = (paper_scenario(1, rate_hz=50) if motion == "paper" else hand(1, motion)).recording
    assert change_of(recording).significance < 3.0


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_a_change_is_placed_near_where_it_was(hand, share):
    recording = hand(1, "continuous").recording
    at = 1000 + int(share * 4000)  # of what follows ten seconds of rest
    acc = recording.acc.copy()
    acc[at:] += [0.6, -0.6, 0.6]
    change = change_of(replace(recording, acc=acc))
    assert change.significance > 8.0
    assert abs(change.t_s - recording.t[at]) < 1.0
    assert not change.rests_often


def test_what_warming_does_is_no_change(hand):
    recording = hand(1, "pose12").recording
    acc = recording.acc.copy()
    acc[3000:] += [0.02, -0.02, 0.02]
    change = change_of(replace(recording, acc=acc))
    assert change.rests_often
    assert change.significance < 5.0


def test_one_newton_step_finds_the_change_of_a_linear_problem():
    """Least squares of y = A (theta + [later] d): the step is the exact solution, and its covariance that of d."""
    rng = np.random.default_rng(0)
    first, second = 30.0 * rng.standard_normal((2, 200, 20))
    d = 0.01 * rng.standard_normal(12)
    y = [np.zeros(200), second[:, :12] @ d]
    H = first.T @ first + second.T @ second
    step, covariance = change_detection._newton(
        H, -(first.T @ y[0] + second.T @ y[1]), (second.T @ second)[:, :12], -(second.T @ y[1])[:12]
    )
    np.testing.assert_allclose(step, d, atol=1e-5)
    A = np.block([[first, np.zeros((200, 12))], [second, second[:, :12]]])
    np.testing.assert_allclose(covariance, np.linalg.inv(A.T @ A)[20:, 20:], rtol=1e-3, atol=1e-8)


def test_too_short_to_tell(hand):
    assert change_of(hand(1, "continuous").recording.part(0, 1300)) is None
