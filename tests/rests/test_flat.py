from dataclasses import replace

import numpy as np
import pytest

from mpucal.data import Recording
from mpucal.rests.flat import QUIETEST_ACC_MPS2, find_flat, flat_statistics
from tools.lab.scenarios.recordings import paper_scenario


def record(acc, gyr, rate_hz=100.0):
    """Return a recording of rows (n, 3)."""
    return Recording.from_arrays(np.arange(len(acc)) / rate_hz, acc, gyr)


def parts(*spans, rate_hz=100.0, noise=(0.02, 0.002), seed=0):
    """Return a recording of consecutive spans (seconds, mean acceleration, mean rate), with white noise."""
    rng = np.random.default_rng(seed)
    acc, gyr = [], []
    for seconds, a, w in spans:
        n = round(seconds * rate_hz)
        acc.append(a + noise[0] * rng.standard_normal((n, 3)))
        gyr.append(w + noise[1] * rng.standard_normal((n, 3)))
    return record(np.concatenate(acc), np.concatenate(gyr), rate_hz)


UP, ASIDE, REST, TURNING = np.array([0, 0, 9.8]), np.array([9.8, 0, 0]), np.zeros(3), np.array([0.6, 0, 0])


@pytest.mark.parametrize("rate_hz", [20.0, 100.0, 1000.0])
def test_the_ten_flat_seconds_at_the_start_are_found(hand, rate_hz):
    for made in (paper_scenario(0, rate_hz=rate_hz), *([hand(0, "pose9")] if rate_hz == 100.0 else [])):
        first, last = find_flat(replace(made.recording, flat=None))
        assert first <= 1.0 * rate_hz
        # The segment lies within the rest and is most of it: a slow turn looks still for a moment.
        assert 8.0 * rate_hz <= last <= 10.3 * rate_hz


def test_a_turn_at_constant_rate_has_no_variance_and_is_no_rest():
    rate_hz, omega = 100.0, 0.3
    t = np.arange(3000) / rate_hz
    turning = 9.8 * np.stack([0 * t, np.sin(omega * t), np.cos(omega * t)], axis=1)
    assert find_flat(record(turning, np.tile([omega, 0, 0], (3000, 1)))) is None


BUMP = (2, UP, TURNING)


@pytest.mark.parametrize(
    ("spans", "first", "last"),
    [
        ([(6, UP, REST), (6, ASIDE, REST)], (0, 100), (500, 600)),
        ([(6, UP, REST), (6, UP, TURNING)], (0, 100), (500, 600)),
        ([(10, UP, REST + 1.0)], (0, 100), (900, 1000)),
        ([(6, UP, REST), BUMP, (20, ASIDE, REST)], (0, 100), (500, 600)),
        ([(1, ASIDE, REST), BUMP, (20, UP, REST)], (300, 400), (2200, 2300)),
    ],
    ids=["another side", "a turn", "a large bias", "earliest of long ones", "a short one before"],
)
def test_the_flat_segment_is_the_earliest_long_rest_and_ends_with_it(spans, first, last):
    found = find_flat(parts(*spans))
    assert first[0] <= found[0] <= first[1]
    assert last[0] <= found[1] <= last[1]


@pytest.mark.parametrize("taken_up", [0.1, 0.2, 0.3])
def test_a_short_flat_segment_ends_before_the_board_is_taken_up(taken_up):
    """A hand that begins to lift the board turns it by so little at first that the window is still."""
    lifted = (taken_up, 1.025 * UP, np.array([0.03, -0.02, 0.0]))
    recording = parts((2.5 - taken_up, UP, REST), lifted, BUMP, (4, ASIDE, REST))
    assert find_flat(recording)[1] <= 250 - 100 * taken_up


def test_a_short_recording_has_no_flat_segment():
    assert find_flat(parts((0.1, UP, REST))) is None
    assert find_flat(parts((0.4, UP, REST))) is None


def test_at_a_low_rate_one_window_may_be_the_flat_segment():
    """A window has four samples at least, 1.3 s at 3 Hz."""
    to_and_fro = [(2 / 3, ASIDE, TURNING), (2 / 3, UP, -TURNING)] * 5
    assert find_flat(parts((4 / 3, UP, REST), *to_and_fro, rate_hz=3.0)) == (0, 4)


def test_a_noisy_sensor_may_lie_still():
    assert find_flat(parts((10, UP, REST), (10, ASIDE, TURNING), noise=(0.3, 0.1)))[1] >= 800


def test_a_gap_ends_a_rest():
    recording = parts((12, UP, REST))
    first, last = find_flat(replace(recording, gap=np.arange(len(recording)) == 600))
    assert not first <= 600 < last


def test_statistics_are_those_of_the_segment():
    rng = np.random.default_rng(3)
    sd_a, sd_omega = np.array([0.1, 0.2, 0.3]), np.array([0.01, 0.02, 0.03])
    acc = [1.0, 2.0, 9.0] + sd_a * rng.standard_normal((20000, 3))
    gyr = [0.1, 0.2, 0.3] + sd_omega * rng.standard_normal((20000, 3))
    flat = flat_statistics(record(acc, gyr), (0, 10000))
    assert flat.n == 10000
    np.testing.assert_allclose(flat.y, [1.0, 2.0, 9.0], atol=0.01)
    np.testing.assert_allclose(flat.b_omega, [0.1, 0.2, 0.3], atol=0.001)
    np.testing.assert_allclose(np.sqrt(flat.Sigma_a), sd_a, rtol=0.03)
    np.testing.assert_allclose(np.sqrt(flat.Sigma_omega), sd_omega, rtol=0.03)


def test_coarse_steps_hide_noise_but_the_variance_keeps_it():
    acc = np.tile([0.0, 0.0, 9.8], (1000, 1))
    acc[500:] += 0.06 * np.arange(500)[:, None]
    flat = flat_statistics(record(0.06 * np.rint(acc / 0.06), np.zeros((1000, 3))), (0, 400))
    np.testing.assert_allclose(np.sqrt(flat.Sigma_a), 0.06 / np.sqrt(12.0), rtol=1e-6)


@pytest.mark.parametrize("noise", [0.06, 2.0])
def test_a_mean_of_readings_on_one_step_is_no_finer_than_the_step(noise):
    rng, step = np.random.default_rng(2), 0.01
    off, claimed = [], []
    for true in rng.uniform(10.0 * step, 11.0 * step, (60, 3)):
        acc = step * np.rint((true + rng.normal(0.0, noise * step, (500, 3))) / step)
        recording = Recording.from_arrays(np.arange(500) / 100.0, acc, np.zeros((500, 3)))
        of = flat_statistics(replace(recording, sensor=replace(recording.sensor, steps=(step, 0.0))), (0, 500))
        off.append(of.y - true)
        claimed.append(np.sqrt(of.Sigma_a / of.worth))
    z = np.sqrt(np.mean(np.square(np.array(off) / claimed)))
    # An axis that leaves its step sometimes has a smaller error than claimed.
    assert 0.4 < z < 1.3


@pytest.mark.parametrize("most", [1.0, 20.0])
def test_a_bias_of_rates_that_stay_on_one_step_is_no_finer_than_the_step(most):
    rng, step = np.random.default_rng(4), 1e-3
    off, claimed = [], []
    for true in rng.uniform(-most * step, most * step, (60, 3)):
        whole = np.trunc(true / step)  # as a vehicle's stream truncates: values between -1 and 1 are zero
        gyr = np.tile(step * (whole + 0.5 * np.sign(whole)), (500, 1))
        recording = Recording.from_arrays(np.arange(500) / 100.0, np.tile(UP, (500, 1)), gyr)
        of = flat_statistics(replace(recording, sensor=replace(recording.sensor, steps=(0.0, step))), (0, 500))
        off.append(of.b_omega - true)
        claimed.append(of.b_omega_std)
    assert 0.8 < np.sqrt(np.mean(np.square(np.array(off) / claimed))) < 1.2


def test_data_without_noise_still_have_a_variance():
    flat = flat_statistics(record(np.tile(UP, (100, 1)), np.zeros((100, 3))), (0, 50))
    np.testing.assert_allclose(flat.Sigma_a, QUIETEST_ACC_MPS2**2)
    assert (flat.Sigma_omega > 0).all()
