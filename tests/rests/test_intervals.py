from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics
from mpucal.rests.gyro_drift import remove_drift
from mpucal.rests.intervals import RestFinder, gravity_turns
from mpucal.rests.limits import ANY_HAND


def found(simulated):
    recording = simulated.recording
    flat = flat_statistics(recording, recording.flat)
    return recording, flat, RestFinder(recording, flat).typical()


@pytest.mark.parametrize(("motion", "tremble"), [("pose6", True), ("pose12", False), ("pose12", True)])
def test_every_pose_and_nothing_else_is_found(hand, motion, tremble):
    simulated = hand(1, motion, tremble=tremble)
    recording, _, runs = found(simulated)
    number = int(motion[4:])
    assert number - (2 if tremble else 0) <= len(runs) <= number + (4 if tremble else 0)
    for a, b in runs:
        assert b - a >= 0.3 * recording.rate_hz
        # A pose with a tremor of 1 deg/s at 2 Hz is a rest.
        assert np.ptp(simulated.specific_force[a:b], axis=0).max() < (0.2 if tremble else 0.01)


def test_a_hand_that_never_rests_has_only_the_flat_run(hand):
    _, flat, runs = found(hand(1, "continuous"))
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


@pytest.mark.parametrize(("n", "g"), [(20, 1.0), (1500, 0.0)], ids=["shorter than a window", "zeros"])
def test_a_recording_shorter_than_a_window_or_of_zeros_has_no_rests(n, g):
    gyr = 0.002 * np.random.default_rng(0).standard_normal((n, 3))
    recording = Recording.from_arrays(0.01 * np.arange(n), np.full((n, 3), g), gyr)
    with np.errstate(all="raise"):
        assert len(RestFinder(recording, flat_statistics(recording, (0, n // 2))).typical()) == 0


def test_a_run_of_one_sample_may_turn_at_any_rate(in_hand):
    turns = gravity_turns(in_hand.recording, np.array([[10, 11], [10, 400]]))
    assert turns[0] == np.inf and np.isfinite(turns[1])


@pytest.mark.parametrize(
    "drift", [lambda t: 1e-3 * t, lambda t: 0.02 * np.sin(t / 15.0), np.zeros_like], ids=["a line", "a wave", "none"]
)
def test_drift_is_removed_and_a_bias_that_stays_is_left_nearly_alone(in_hand, drift):
    whole = in_hand.recording
    recording = replace(whole, gyr=whole.gyr + drift(whole.t)[:, None] * [1.0, -0.5, 0.2])
    flat = flat_statistics(recording, recording.flat)
    mended = remove_drift(recording, flat, RestFinder(recording, flat).typical())
    bias = flat.b_omega - flat_statistics(whole, recording.flat).b_omega
    before, after = (np.abs(r.gyr - whole.gyr - bias)[1000:] for r in (recording, mended))
    one_rest = np.sqrt(flat.Sigma_omega / 150).max()
    assert np.sqrt((after**2).mean()) < 0.15 * np.sqrt((before**2).mean()) + one_rest


def test_a_sensitivity_to_acceleration_is_removed_where_the_rests_show_it(in_hand):
    """Add 0.1 deg/s per g to the rates of a board on a table, which turns from side to side, and to those of a hand."""
    hand, rng = in_hand.recording, np.random.default_rng(0)
    sides = np.repeat(np.concatenate([np.eye(3), -np.eye(3)] * 2)[[2, 0, 1, 5, 3, 4] * 2], 200, axis=0)
    table = Recording.from_arrays(
        0.01 * np.arange(2400), 9.8 * sides + rng.normal(0.0, 0.03, sides.shape), rng.normal(0.01, 1e-3, sides.shape)
    )
    sensitivity = np.radians(0.1) / 9.8 * rng.standard_normal((3, 3))
    for recording, flat, runs, left in (
        (table, (0, 200), 200 * np.stack([np.arange(12), np.arange(1, 13)], axis=1), 0.1),
        (hand, hand.flat, RestFinder(hand, flat_statistics(hand, hand.flat)).typical(), 1.2),
    ):
        sensitive = replace(recording, gyr=recording.gyr + recording.acc @ sensitivity.T)
        one, other = (remove_drift(each, flat_statistics(each, flat), runs).gyr for each in (recording, sensitive))
        away, added = (values - values[slice(*flat)].mean(0) for values in (other - one, sensitive.gyr - recording.gyr))
        assert np.sqrt(np.mean(away**2)) < left * np.sqrt(np.mean(added**2))


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
