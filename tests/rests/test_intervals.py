from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics
from mpucal.rests.gyro_drift import remove_drift
from mpucal.rests.intervals import RestFinder
from mpucal.rests.limits import ANY_HAND


def found(simulated):
    recording = simulated.recording
    flat = flat_statistics(recording, recording.flat)
    return recording, flat, RestFinder(recording, flat).typical()


@pytest.mark.parametrize("motion", ["pose6", "pose9", "pose12"])
@pytest.mark.parametrize("tremble", [False, True], ids=["set down", "trembling"])
def test_it_finds_every_pose_and_nothing_else(hand, motion, tremble):
    for seed in range(2):
        simulated = hand(seed, motion, tremble=tremble)
        recording, _, runs = found(simulated)
        number = int(motion[4:])
        assert number - (2 if tremble else 0) <= len(runs) <= number + (4 if tremble else 0)
        s = simulated.specific_force
        for a, b in runs:
            assert b - a >= 0.3 * recording.rate_hz
            # A pose with a tremor of 1 deg/s at 2 Hz is a rest.
            assert np.ptp(s[a:b], axis=0).max() < (0.2 if tremble else 0.01)


@pytest.mark.parametrize("motion", ["continuous", "wobble100"])
def test_a_hand_that_never_rests_has_only_the_flat_run(hand, motion):
    _, flat, runs = found(hand(0, motion))
    assert (runs[:, 0] < flat.last).all()


def test_a_turn_at_constant_rate_is_no_rest():
    rng = np.random.default_rng(0)
    gyr = 0.001 * rng.standard_normal((2000, 3))
    gyr[1000:, 2] += 0.5
    acc = [0.0, 0.0, 9.8] + 0.01 * rng.standard_normal((2000, 3))
    recording = Recording.from_arrays(0.01 * np.arange(2000), acc, gyr)
    runs = RestFinder(recording, flat_statistics(recording, (0, 900))).typical()
    assert runs[:, 1].max() <= 1010


def test_a_gap_divides_a_rest(in_hand):
    recording = in_hand.recording
    gap = np.zeros(len(recording), bool)
    gap[500] = True
    flat = flat_statistics(recording, recording.flat)
    runs = RestFinder(replace(recording, gap=gap), flat).typical()
    assert not any(a <= 500 < b for a, b in runs)
    assert len(runs) == len(RestFinder(recording, flat).typical()) + 1


def test_a_recording_shorter_than_a_window_has_no_rests():
    recording = Recording.from_arrays(0.01 * np.arange(20), np.ones((20, 3)), np.zeros((20, 3)))
    assert RestFinder(recording, flat_statistics(recording, (0, 20))).typical().shape == (0, 2)


def test_zeros_of_the_accelerometer_are_no_rest():
    gyr = 0.002 * np.random.default_rng(0).standard_normal((1500, 3))
    recording = Recording.from_arrays(0.01 * np.arange(1500), np.zeros((1500, 3)), gyr)
    with np.errstate(all="raise"):
        assert len(RestFinder(recording, flat_statistics(recording, (0, 800))).typical()) == 0


def drifting(in_hand, drift):
    recording = in_hand.recording
    return replace(recording, gyr=recording.gyr + drift(recording.t)[:, None] * [1.0, -0.5, 0.2])


@pytest.mark.parametrize(
    "drift",
    [lambda t: 1e-3 * t, lambda t: 0.02 * np.sin(t / 15.0), lambda t: 0.02 * (1 - np.exp(-t / 20.0))],
    ids=["a line", "a wave", "warming up"],
)
def test_drift_is_removed(in_hand, drift):
    recording = drifting(in_hand, drift)
    flat = flat_statistics(recording, recording.flat)
    runs = RestFinder(recording, flat).typical()
    mended = remove_drift(recording, flat, runs)
    for a, b in runs[1:]:
        np.testing.assert_allclose(mended.gyr[a:b].mean(0), flat.b_omega, atol=5e-4)
    bias = flat.b_omega - flat_statistics(in_hand.recording, recording.flat).b_omega
    before, after = (np.abs(r.gyr - in_hand.recording.gyr - bias)[1000:] for r in (recording, mended))
    assert np.sqrt((after**2).mean()) < 0.15 * np.sqrt((before**2).mean())


def test_a_bias_that_stays_is_left_nearly_alone(in_hand):
    recording = in_hand.recording
    flat = flat_statistics(recording, recording.flat)
    mended = remove_drift(recording, flat, RestFinder(recording, flat).typical())
    one_rest = np.sqrt(flat.Sigma_omega / 150).max()
    assert np.abs(mended.gyr - recording.gyr).max() < 2.0 * one_rest


def test_a_slow_turn_about_gravity_is_no_bias(in_hand):
    """Turn the board about gravity at 2 deg/s for 0.8 s between two turns: only its shortness excludes it."""
    recording = in_hand.recording
    flat = flat_statistics(recording, recording.flat)
    at = recording.flat[1] + 200
    acc, gyr = recording.acc.copy(), recording.gyr.copy()
    gyr[at - 200 :] = flat.b_omega + np.array([1.0, 0.0, 0.0])
    acc[at : at + 80] = flat.y + 0.01 * np.random.default_rng(0).standard_normal((80, 3))
    gyr[at : at + 80] = flat.b_omega + np.array([0.0, 0.0, np.radians(2.0)])
    turning = replace(recording, acc=acc, gyr=gyr)
    runs = RestFinder(turning, flat).typical()
    assert any(at < a < at + 80 for a, _ in runs)
    assert remove_drift(turning, flat, runs) is turning


def test_one_rest_shows_no_drift(in_hand):
    recording = in_hand.recording
    flat = flat_statistics(recording, recording.flat)
    assert remove_drift(recording, flat, np.array([[0, 900]])) is recording


def test_rests_with_a_turn_as_slow_as_a_tremor_between_them_are_two():
    rng = np.random.default_rng(3)
    rate = np.zeros((700, 3))
    rate[400:500, 0] = np.radians(6.0)
    up = Rotation.from_rotvec(0.01 * np.cumsum(rate, axis=0)).inv().apply([0.0, 0.0, 9.81])
    gyr = rate + 0.001 * rng.standard_normal((700, 3))
    recording = Recording.from_arrays(0.01 * np.arange(700), up + 0.02 * rng.standard_normal((700, 3)), gyr)
    runs = RestFinder(recording, flat_statistics(recording, (0, 200))).within(ANY_HAND)
    assert len(runs) == 2
    assert runs[0, 1] < 420
    assert runs[1, 0] > 480
