"""A second accelerometer of the same board, whose readings come in whole milli-g, against its truth."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate_all
from mpucal.data import STANDARD_GRAVITY_MPS2, Sensor
from tools.lab.judge import judged

D = np.array([[1.01, 0.002, -0.003], [0.001, 0.985, 0.002], [-0.002, 0.003, 1.02]])
B_A = np.array([0.31, -0.22, 0.17])
G = 9.82
# The second gyroscope: its matrix, how it is turned against the first one, and the drift of its bias [rad/s^2].
K = np.array([[1.03, 0.02, -0.02], [0.02, 0.97, 0.02], [-0.02, 0.02, 1.0]])
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
DRIFT = 2e-5
STEP_MPS2 = STANDARD_GRAVITY_MPS2 / 1000.0
SENSOR = Sensor(chip="second", steps=(STEP_MPS2, 1e-3))


def second(run, seed=0):
    """Return the recording of a second accelerometer that feels what the first one does."""
    first, truth = run.recording, run.truth
    felt = (first.acc - truth.b_a) @ np.linalg.inv(truth.D).T
    noise = np.random.default_rng(seed).normal(0.0, 0.1 * STEP_MPS2, felt.shape)
    acc = STEP_MPS2 * np.rint((felt @ D.T + B_A + noise) / STEP_MPS2)
    return replace(first, acc=acc, sensor=SENSOR, name="second")


def turned(run, lag_s):
    """Return the recording of a second sensor whose gyroscope, turned against the first one's, is late and coarse."""
    other = second(run)
    late = np.stack([np.interp(other.t - lag_s, other.t, rates) for rates in other.gyr.T], axis=1)
    rates = late @ (np.linalg.inv(K) @ TURN @ run.truth.K).T + DRIFT * other.t[:, None]
    return replace(other, gyr=1e-3 * np.rint(rates / 1e-3))


def together(run, other):
    return calibrate_all(replace(run.recording, others=(other,)), gravity=G)


@pytest.fixture(scope="module")
def runs(hand):
    return [hand(seed, "pose12") for seed in range(2)]


def test_the_second_sensor_is_determined_as_well_as_the_first(runs):
    pairs = [together(run, second(run)) for run in runs]
    for first, other in pairs:
        assert other.verdict == "good"
        assert other.magnitude_std < 1.02 * first.magnitude_std
    z = [judged(other, (D, B_A)).z for _, other in pairs]
    assert 0.3 < np.sqrt(np.mean(np.square(z))) < 1.5  # sensors that are linear, unlike what the claims hold


@pytest.mark.parametrize("lag_s", [0.0, 0.004])
def test_the_frame_of_the_second_has_right_standard_deviations(runs, lag_s):
    apart = []
    for run in runs:
        other = together(run, turned(run, lag_s))[1]
        apart.append((other.D @ TURN - D) / np.sqrt((other.D_std**2) @ np.square(TURN)))
    assert 0.3 < np.sqrt(np.mean(np.square(apart))) < 0.9


def test_a_sensor_that_slipped_or_recorded_at_another_time_keeps_its_own_estimate(runs):
    other = second(runs[0])
    acc = other.acc.copy()
    acc[len(other) // 2 :] += 0.2
    for spoilt in (replace(other, acc=acc), replace(other, t=other.t + 1000.0)):
        alone, beside = calibrate_all(spoilt, gravity=G)[0], together(runs[0], spoilt)[1]
        assert beside.quality == alone.quality
        assert np.array_equal(beside.b_a, alone.b_a)
