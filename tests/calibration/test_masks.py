"""Masks: exactly the clipped samples and gaps are found, and the series treats them as such."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.calibration.masks import ACC_RANGES, GYRO_RANGES, mask, with_masks
from mpucal.calibration.problem import Series
from mpucal.calibration.rotation import rotation, units
from mpucal.data import Recording
from mpucal.rests.flat import flat_statistics
from mpucal.rests.windows import noise_variance
from tools.lab.judge import judged, sph_rms
from tools.lab.scenarios.body import attitudes, specific_force


def noise(n=1000, seed=0, **changes):
    """Return a recording of noise about gravity."""
    rng = np.random.default_rng(seed)
    acc = [0.0, 0.0, 9.8] + 3.0 * rng.standard_normal((n, 3))
    return replace(Recording.from_arrays(0.01 * np.arange(n), acc, rng.standard_normal((n, 3))), **changes)


def test_white_noise_is_neither_clipped_nor_broken():
    for seed in range(20):
        marked = with_masks(noise(seed=seed))
        assert not (marked.gap | marked.acc_clipped | marked.gyr_clipped).any()


def test_a_spike_of_one_rate_is_removed_and_a_blow_is_kept():
    """A word of a file that jumps and returns was spoilt: a turn by some degrees. A blow moves more than one word."""
    t = 0.01 * np.arange(1000)
    acc = [0.0, 0.0, 9.8] + 0.02 * np.sin(7.0 * t)[:, None] * np.ones(3)
    gyr = np.stack([np.sin(t), np.cos(t), 0.1 * t], axis=1)
    spoilt, blow = gyr.copy(), acc.copy()
    spoilt[400, 1] += 8.7
    blow[500] += 3.0
    found = with_masks(Recording.from_arrays(t, blow, spoilt))
    np.testing.assert_allclose(found.gyr, gyr, atol=1e-4)
    np.testing.assert_array_equal(found.acc, blow)


@pytest.mark.parametrize("jitter", [0.0, 0.4], ids=["even", "jittered"])
def test_a_gap_is_where_time_jumps(pick, jitter):
    recording = noise()
    rng = np.random.default_rng(1)
    recording = replace(recording, t=recording.t + 0.01 * jitter * rng.uniform(-1, 1, 1000))
    kept = np.ones(1000, bool)
    kept[300:304] = kept[700:800] = False
    assert np.flatnonzero(with_masks(pick(recording, kept)).gap).tolist() == [300, 696]


def test_samples_at_the_end_of_a_range_are_clipped():
    recording = noise()
    full_scale = GYRO_RANGES[1]
    gyr = np.clip(0.4 * full_scale * recording.gyr, -full_scale, full_scale * 32767 / 32768)
    at_the_end = (np.abs(gyr) >= full_scale * 32767 / 32768).any(1)
    assert 2 < at_the_end.sum() < 100
    np.testing.assert_array_equal(with_masks(replace(recording, gyr=gyr)).gyr_clipped, at_the_end)
    full_scale = ACC_RANGES[1]
    acc = np.clip(0.35 * full_scale * (recording.acc - [0, 0, 9.8]), -full_scale, full_scale)
    at_the_end = (np.abs(acc) == full_scale).any(1)
    np.testing.assert_array_equal(with_masks(replace(recording, acc=acc)).acc_clipped, at_the_end)


@pytest.mark.parametrize("peak", [1.0, 1.1], ids=["at the range", "beyond it"])
def test_a_slow_peak_at_a_range_is_clipped_only_if_it_is_cut_off(peak):
    """Coarse steps repeat the largest reading of a slow peak: that it lies at a chip's range may be chance."""
    recording = noise()
    full_scale, step = GYRO_RANGES[0], np.deg2rad(1.0 / 16.4)
    turn = peak * full_scale * np.sin(0.8 * recording.t)
    gyr = 1e-3 * recording.gyr
    gyr[:, 0] = np.minimum(step * np.rint(turn / step), full_scale)
    at_the_end = gyr[:, 0] == gyr[:, 0].max()
    assert at_the_end.sum() >= 2
    np.testing.assert_array_equal(with_masks(replace(recording, gyr=gyr)).gyr_clipped, at_the_end & (peak > 1.0))


def test_clipping_at_another_value_must_be_long_and_far_from_rest():
    recording = noise()
    t = recording.t
    gyr = recording.gyr * 0.001
    gyr[400:500, 1] = np.minimum(5.0 * np.sin(np.pi * (t[400:500] - 4.0)), 3.3)
    marked = with_masks(replace(recording, gyr=gyr))
    np.testing.assert_array_equal(marked.gyr_clipped, gyr[:, 1] == 3.3)


@pytest.mark.parametrize(
    "change",
    [lambda acc: acc * [0.0, 1.0, 1.0], lambda acc: np.rint(acc / 2.0) * 2.0],
    ids=["a constant axis", "coarse counts"],
)
def test_values_that_repeat_without_a_rail_are_not_clipped(change):
    recording = noise()
    assert not with_masks(replace(recording, acc=change(recording.acc))).acc_clipped.any()


def test_an_acceleration_that_is_cut_off_at_any_value_is_clipped():
    recording = noise()
    acc = recording.acc.copy()
    acc[:, 1] = np.minimum(acc[:, 1], 0.5)  # where noise would spread it, and no steady motion
    np.testing.assert_array_equal(with_masks(replace(recording, acc=acc)).acc_clipped, acc[:, 1] == 0.5)


def test_a_rest_before_a_steady_turn_is_not_clipped():
    """Turn the board at one rate, with a gyroscope of so little noise that coarse steps repeat."""
    recording = noise()
    counts = np.rint(328.4 * (recording.t > 4.0)[:, None] + 0.1 * recording.gyr)
    assert not with_masks(replace(recording, gyr=np.deg2rad(counts / 16.4))).gyr_clipped.any()


def drawn(recording, first, last, at=slice(None)):
    """Return the recording with a line through samples first..last-1 of its gyroscope."""
    gyr = recording.gyr.copy()
    share = np.linspace(0.0, 1.0, last - first + 2)[1:-1, None]
    gyr[first:last, at] = ((1.0 - share) * gyr[first - 1] + share * gyr[last])[:, at]
    return replace(recording, gyr=gyr)


def test_a_line_drawn_through_lost_rates_is_a_gap():
    gap = with_masks(drawn(noise(), 300, 420)).gap
    assert gap[302:418].all()
    assert not gap[:299].any()
    assert not gap[421:].any()


def test_a_line_of_one_axis_a_constant_rate_and_computed_rates_are_no_gap():
    gyr = noise().gyr.copy()
    gyr[:400] = 0.01  # as of a sensor with coarse steps at rest
    t = 0.01 * np.arange(1000)
    ramps = np.abs((t[:, None] % 4.0) - 2.0) * [1.0, -0.5, 0.2]
    for recording in (drawn(noise(), 300, 420, at=[0]), replace(noise(), gyr=gyr), replace(noise(), gyr=ramps)):
        assert not with_masks(recording).gap.any()


def frozen(simulated, begin, seconds, acc=(), gyr=()):
    """Return the calibration of a recording in which some axes read the same from a sample on."""
    recording = simulated.recording
    spoilt = replace(recording, acc=recording.acc.copy(), gyr=recording.gyr.copy())
    end = begin + round(seconds * recording.rate_hz)
    for values, axes in ((spoilt.acc, acc), (spoilt.gyr, gyr)):
        values[begin:end, list(axes)] = values[begin, list(axes)]
    return calibrate(spoilt, gravity=simulated.truth.gravity)


def turning(recording):
    """Return the first sample of a fast turn about y."""
    rates = np.abs(recording.gyr[:, 1])
    return int(np.flatnonzero(rates > 0.5 * rates.max())[0])


@pytest.mark.parametrize(("axes", "named"), [([1], "y"), ([0, 2], "x and z"), ([0, 1, 2], "x and y and z")])
def test_a_rate_that_repeats_while_the_board_turns_is_a_frozen_axis(hand, axes, named):
    simulated = hand(3, "pose12")
    begin = turning(simulated.recording)
    spoilt, t_s = frozen(simulated, begin, 3.0, gyr=axes), simulated.recording.t[begin] - simulated.recording.t[0]
    (reason,) = spoilt.quality["reasons"]
    assert (spoilt.verdict, reason["code"]) == ("usable", "bits_stuck")
    assert f"the gyroscope reads the same on {named} from {t_s:.0f} to {t_s + 3.0:.0f} s" in reason["message"]
    assert judged(spoilt, (simulated.truth.D, simulated.truth.b_a)).farthest < 4.0


def test_a_gyroscope_that_freezes_at_rest_is_told_by_the_turns_that_follow(hand):
    simulated = hand(3, "pose12")
    middle = len(simulated.recording) // 2
    at_rest = middle + int(np.abs(simulated.recording.gyr[middle : middle + 500]).max(1).argmin())
    spoilt = frozen(simulated, at_rest, 10.0, gyr=[0, 1, 2])
    assert [reason["code"] for reason in spoilt.quality["reasons"]] == ["bits_stuck"]


def test_a_rate_that_freezes_for_good_is_named_as_such(hand):
    spoilt = frozen(hand(3, "pose12"), turning(hand(3, "pose12").recording), 1e3, gyr=[1])
    assert spoilt.verdict == "refused"
    codes = {reason["code"]: reason["message"] for reason in spoilt.quality["reasons"]}
    assert "the gyroscope reads the same on y from" in codes["bits_stuck"]
    assert "data_lost" not in codes


def test_whole_samples_that_repeat_are_lost_data(hand):
    spoilt = frozen(hand(3, "pose12"), turning(hand(3, "pose12").recording), 3.0, [0, 1, 2], [0, 1, 2])
    assert "data_lost" in [reason["code"] for reason in spoilt.quality["reasons"]]


def test_masks_reduce_the_error_by_a_clipped_gyroscope(hand, monkeypatch):
    simulated = hand(3, "pose12")
    recording, truth = simulated.recording, simulated.truth
    limit = np.deg2rad(125.0)
    clipped = replace(recording, gyr=np.clip(recording.gyr, -limit, limit))
    assert 20 < (np.abs(clipped.gyr) == limit).any(1).sum() < 400
    saved = calibrate(clipped, "hand", truth.gravity)
    monkeypatch.setattr("mpucal.calibration.estimation.with_masks", lambda recording: recording)
    blind = calibrate(clipped, "hand", truth.gravity)
    assert sph_rms(truth, saved.D, saved.b_a) < 0.1 * sph_rms(truth, blind.D, blind.b_a)


@pytest.mark.parametrize("rate_hz", [50, 100, 1000])
@pytest.mark.parametrize("form", [lambda x: 16.0 * (x - x * x) ** 2, lambda x: np.sin(np.pi * x)], ids=["hand", "sine"])
def test_a_turn_beyond_the_range_is_nearly_known(form, rate_hz):
    """Turn at up to 350 deg/s in 0.5 s: the rates go on with their slopes, and the error is within what is said."""
    t = np.arange(0.0, 8.0, 1.0 / rate_hz)
    turn = np.deg2rad(350.0) * form(np.clip((t - 6.0) / 0.5, 0.0, 1.0))
    rng, limit = np.random.default_rng(0), np.deg2rad(250.0)
    true = turn[:, None] * [0.0, 0.0, 1.0] + rng.normal(0.0, 0.001, (len(t), 3))
    acc = rng.normal([0.0, 0.0, 9.8], 0.03, (len(t), 3))
    recording = with_masks(Recording.from_arrays(t, acc, np.clip(true, -limit, limit)))
    lost, left = (np.sum(true - gyr, axis=0)[2] / rate_hz for gyr in (np.clip(true, -limit, limit), recording.gyr))
    assert abs(left) < 0.25 * lost
    flat = flat_statistics(recording, (0, 5 * rate_hz))
    std = np.sqrt(mask(Series.after(recording, flat), recording, flat).q_extra.sum())
    assert abs(left) < 2.0 * std < lost


def test_a_turn_that_stays_beyond_the_range_is_unknown():
    rng, n, limit = np.random.default_rng(0), 1000, np.deg2rad(250.0)
    gyr = rng.normal(0.0, 0.001, (n, 3))
    gyr[600:700, 2] += 2.0 * limit
    acc, clipped = rng.normal([0.0, 0.0, 9.8], 0.03, (n, 3)), np.clip(gyr, -limit, limit)
    recording = with_masks(Recording.from_arrays(0.01 * np.arange(n), acc, clipped))
    assert recording.gyr.max() == limit
    flat = flat_statistics(recording, (0, 500))
    assert np.sqrt(mask(Series.after(recording, flat), recording, flat).q_extra.sum()) > 0.5


def test_a_board_may_lie_on_the_other_side_after_a_gap():
    """Lose four seconds in which a board was turned over: gravity tells how, and its change is no noise."""
    rng, n, up = np.random.default_rng(0), 1000, np.array([0.1, 0.0, 9.8])
    acc = np.where(np.arange(n)[:, None] < 500, up, [0.3, -0.2, -9.8]) + 0.05 * rng.standard_normal((n, 3))
    t = 0.01 * np.arange(n) + 4.0 * (np.arange(n) >= 500)
    recording = with_masks(Recording.from_arrays(t, acc, 0.01 + 0.001 * rng.standard_normal((n, 3))))
    flat = flat_statistics(recording, (0, 400))
    series = mask(Series.after(recording, flat), recording, flat)
    turn = rotation(-(series.omega[100] - flat.b_omega) * series.dt[100])
    assert np.abs(turn @ acc[499] / 9.8 - acc[500] / 9.8).max() < 0.02
    assert noise_variance(recording).max() < 3.0 * 0.05**2


def test_short_gaps_cost_little(hand, pick):
    """A hand's rate is interpolated across a gap of 40 ms, in which a turn of 0.2 rad would else be unknown."""
    simulated = hand(3, "pose12")
    recording, truth = simulated.recording, simulated.truth
    kept = np.ones(len(recording), bool)
    places = np.arange(recording.flat[1], len(recording) - 10, 20)
    for first in np.random.default_rng(2).choice(places, 60, replace=False):
        kept[first : first + 3] = False
    lossy = pick(recording, kept)
    assert with_masks(lossy).gap.sum() == 60
    whole, found = (calibrate(of, "hand", truth.gravity) for of in (recording, lossy))
    assert sph_rms(truth, found.D, found.b_a) < 2.0 * sph_rms(truth, whole.D, whole.b_a)
    off = np.abs(np.append((found.D - truth.D) / found.D_std, (found.b_a - truth.b_a) / found.b_a_std))
    assert off.max() < 4.0


@pytest.mark.parametrize("frozen", [False, True], ids=["even", "frozen"])
def test_coarse_rates_that_repeat_as_a_machine_turns_evenly_are_neither_clipped_nor_frozen(frozen):
    """Turn at 30 deg/s about six axes, with steps of 0.06 deg/s above the noise; a gyroscope that froze is found."""
    axes = units(np.array([[1.0, 0, 0], [0, 1, 0], [1, 1, 0], [0, -1, 0], [1, 0, 1], [0, 1, 1]]))
    omega = np.repeat(np.vstack([np.zeros(3), np.radians(30.0) * axes]), 1000, axis=0)
    rng = np.random.default_rng(0)
    acc = specific_force(attitudes(omega, 0.01), 9.8, np.zeros(3)) + rng.normal(0.0, 0.02, omega.shape)
    step = np.radians(0.06)
    gyr = step * np.rint((omega + rng.normal(0.01, 0.1 * step, omega.shape)) / step)
    if frozen:
        gyr[5500:] = gyr[1500]
    marked = with_masks(Recording.from_arrays(0.01 * np.arange(len(acc)), acc, gyr))
    assert not marked.gyr_clipped.any()
    assert marked.gap[5600:].all() == marked.gap.any() == frozen
