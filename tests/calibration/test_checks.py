"""Checks of an estimate: a constructed recording for each fault, its verdict, reason, and the words of the sentence."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from mpucal import load
from mpucal.calibration import calibrate, estimate
from mpucal.calibration.parameters import HAND
from mpucal.calibration.quality import judge
from mpucal.calibration.rotation import rotation
from mpucal.data import Recording
from mpucal.result.calibration import Calibration
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import paper_scenario

G = 9.82
SESSION = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"


@dataclass(frozen=True)
class Judged:
    """Verdict and its reasons, {code: sentence} in their order."""

    verdict: str
    reasons: dict


def judged(recording, model="auto"):
    quality = calibrate(recording, model, G).quality
    reasons = {reason["code"]: reason["message"] for reason in quality["reasons"]}
    for reason in quality["reasons"]:
        assert reason["message"].endswith(f"; {reason['remedy']}")
    assert len(reasons) == len(quality["reasons"]), "a code came twice"
    for sentence in reasons.values():
        assert "nan" not in sentence.split()
        assert not sentence.endswith(".")
    return Judged(quality["verdict"], reasons)


def refused_for(code, recording, *words, model="auto"):
    """Assert that the recording is refused for this code alone, in a sentence with these words."""
    result = judged(recording, model)
    assert result.verdict == "refused"
    assert list(result.reasons) == [code]
    for word in words:
        assert word in result.reasons[code]


def usable_by_rests(recording, *words):
    """Assert a usable estimate from the rests alone, and that only the gyroscope is blamed, in these words."""
    result = judged(recording)
    assert result.verdict == "usable"
    assert list(result.reasons) == ["gyro_off"]
    assert "estimated from the rests alone" in result.reasons["gyro_off"]
    for word in words:
        assert word in result.reasons["gyro_off"]


@pytest.fixture(scope="module")
def good(ideal):
    """Return a recording without a fault."""
    return ideal(0).recording


def test_a_recording_without_a_fault_is_good(good, in_hand):
    for recording in (good, replace(good, flat=None), in_hand.recording):
        assert judged(recording) == Judged("good", {})


def mirrored(axis):
    signs = np.ones(3)
    signs["xyz".index(axis)] = -1.0
    return signs


# ---- recordings that leave nothing to estimate


def shaken(good):
    rng = np.random.default_rng(0)
    return replace(good, gyr=good.gyr + rng.normal(0, 0.5, good.gyr.shape), flat=None)


def last_at_rest(good):
    """Return a recording that ends with its rest; the turn about the vertical before it looks like another rest."""
    return Recording.from_arrays(good.t, np.roll(good.acc, -500, axis=0), np.roll(good.gyr, -500, axis=0))


def accelerations(factor):
    return lambda good: replace(good, acc=good.acc / 9.80665 * factor)


def times(factor):
    return lambda good: replace(good, t=good.t * factor)


REFUSED = {
    "shaken all along": ("never_still", shaken, "never lay still", "table for ten seconds"),
    "turned at once": ("never_still", lambda good: replace(good.part(500, 1500), flat=None), "never lay still"),
    "rest at the end": ("never_still", last_at_rest, "only after 20 s", "before you turn it"),
    "only lying": ("few_orientations", lambda good: good.part(0, 520), "hardly turned", "each of its sides"),
    "in g": ("units_suspect", accelerations(1.0), "in g;", "convert it to m/s^2", "accelerometer"),
    "in mg": ("units_suspect", accelerations(1e3), "in mg;", "convert it to m/s^2", "accelerometer"),
    "counts at 16 g": ("units_suspect", accelerations(2048.0), "in raw counts;", "convert it to m/s^2"),
    "in ms": ("units_suspect", times(1e3), "in milliseconds", "convert them to seconds"),
    "in ns": ("units_suspect", times(1e9), "in nanoseconds", "convert them to seconds"),
    "no rates": ("gyro_off", lambda good: replace(good, gyr=np.zeros_like(good.gyr)), "x and y and z", "wiring"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_a_recording_that_cannot_be_used_is_refused(good, fault):
    code, spoil, *words = REFUSED[fault]
    refused_for(code, spoil(good), *words)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_flat_segment_of_a_few_samples_is_too_short(in_hand, n):
    given = replace(in_hand.recording, flat=(0, n))
    refused_for("never_still", given, f"samples 0 to {n - 1}, is too short", "leave it out")


@pytest.mark.parametrize("model", ["auto", "tilt"])
def test_a_flat_segment_of_a_quarter_of_a_second_suffices(in_hand, model):
    recording = in_hand.recording
    calibration = calibrate(replace(recording, flat=(0, round(0.25 * recording.rate_hz))), model, G)
    assert np.isfinite(calibration.D).all()
    assert np.isfinite(calibration.quality["error_std"]["rms"])


def test_spinning_on_a_table_is_not_turning(in_hand):
    recording = in_hand.recording
    rng = np.random.default_rng(0)
    spinning = recording.gyr * [0.0, 0.0, 1.0] + rng.normal(0, 0.01, recording.gyr.shape)
    on_the_table = np.tile(recording.acc[:1000], (5, 1))
    refused_for("few_orientations", replace(recording, acc=on_the_table, gyr=spinning), "hardly turned")


def test_two_seconds_of_turning_are_too_few_samples(ideal):
    fast = ideal(0, turn_s=2.0, rate_hz=20).recording
    refused_for("few_orientations", fast.part(0, 230), "in 30 samples")


@pytest.mark.parametrize("flat", ["given", "found"])
@pytest.mark.parametrize("noise_rad_s", [0.0, 0.1], ids=["quiet", "noisy"])
def test_rates_in_degrees(good, in_hand, flat, noise_rad_s):
    rng = np.random.default_rng(0)
    for recording in (good, in_hand.recording):
        rates = np.rad2deg(recording.gyr + noise_rad_s * rng.standard_normal(recording.gyr.shape))
        other = replace(recording, gyr=rates, flat=recording.flat if flat == "given" else None)
        refused_for("units_suspect", other, "in deg/s;", "convert it to rad/s", "gyroscope")


@pytest.mark.parametrize("axis", [0, 2])
def test_an_axis_that_stops_midway_is_stuck(in_hand, axis):
    recording = in_hand.recording
    acc = recording.acc.copy()
    acc[1900:2300, axis] = acc[1900, axis]
    refused_for("bits_stuck", replace(recording, acc=acc), f"on {'xyz'[axis]} from 19 to 23 s, though")


@pytest.mark.parametrize(("axes", "from_s"), [([2], 4.7), ([0, 1, 2], 14.1)])
def test_an_accelerometer_that_dies_is_refused_and_its_calibration_can_be_read(axes, from_s, tmp_path):
    recording = load(SESSION)
    acc = recording.acc.copy()
    acc[np.ix_(recording.t - recording.t[0] > from_s, axes)] = 0.0
    calibration = calibrate(replace(recording, acc=acc))
    assert calibration.verdict == "refused"
    calibration.save(tmp_path / "calibration.json")
    assert Calibration.load(tmp_path / "calibration.json") == calibration


def test_an_axis_that_repeats_for_a_second_or_at_rest_is_not_stuck(in_hand):
    recording = in_hand.recording
    for first, last in ((1900, 2050), (0, 900)):
        acc = recording.acc.copy()
        acc[first:last, 2] = acc[first, 2]
        assert "bits_stuck" not in judged(replace(recording, acc=acc)).reasons


@pytest.mark.parametrize("decimals", [9, 3, 2])
def test_gravity_from_a_fusion_filter_is_not_raw(in_hand, decimals):
    acc = in_hand.recording.acc
    gravity = np.round(G * acc / np.linalg.norm(acc, axis=1, keepdims=True), decimals)
    refused_for("not_raw", replace(in_hand.recording, acc=gravity), "stays within", "raw accelerometer")


def test_gravity_in_a_unit_that_is_far_too_small_is_gravity(in_hand):
    recording = in_hand.recording
    refused_for("units_suspect", replace(recording, acc=recording.acc / 1e3), "in a unit about", "times as large")


def test_linear_acceleration_from_a_fusion_filter_is_not_raw(in_hand):
    acc = in_hand.recording.acc
    linear = 0.3 * (acc - G * acc / np.linalg.norm(acc, axis=1, keepdims=True))
    refused_for("not_raw", replace(in_hand.recording, acc=linear), "no gravity in it")


@pytest.mark.parametrize(("motion", "factor"), [("pose12", 2.0), ("turns", 0.25)])
def test_a_gyroscope_of_another_range_is_named_before_the_mount_is_blamed(hand, motion, factor):
    recording = hand(1, motion).recording
    recording = replace(recording, gyr=factor * recording.gyr, sensor=replace(recording.sensor, gyro_range_dps=None))
    words = (f"{1.0 / factor:g} times as far as the gyroscope says", "--gyro-range")
    if motion == "turns":  # rests in three orientations do not suffice
        refused_for("gyro_off", recording, *words)
    else:
        usable_by_rests(recording, *words)


def test_a_known_range_is_named(in_hand):
    recording = replace(in_hand.recording, gyr=0.5 * in_hand.recording.gyr)
    sensor = replace(recording.sensor, gyro_range_dps=250.0, message="a log")
    usable_by_rests(replace(recording, sensor=sensor), "than assumed: ±500 deg/s, read as ±250")


def test_rates_in_counts(in_hand):
    recording = in_hand.recording
    refused_for("units_suspect", replace(recording, gyr=np.rad2deg(recording.gyr) * 131.0), "in raw counts;")


@pytest.mark.parametrize("axis", [0, 1, 2], ids="xyz")
def test_an_axis_that_is_stuck(good, axis):
    for code, sensor, name in (("bits_stuck", "accelerometer", "acc"), ("gyro_off", "gyroscope", "gyr")):
        values = getattr(good, name).copy()
        values[:, axis] = values[0, axis]
        refused_for(code, replace(good, **{name: values}), f"the {sensor} reads the same on {'xyz'[axis]} in every")


def test_a_calibration_without_an_estimate_has_no_numbers(good):
    calibration = calibrate(good.part(0, 520), "auto", G)
    assert np.isnan(calibration.D).all()
    assert np.isnan(calibration.b_a).all()
    assert calibration.fit["converged"] is False


# ---- faults that an estimate shows


@pytest.mark.parametrize(("axis", "turn"), [("x", (500, 1000)), ("y", (1000, 1500))], ids=["about x", "about y"])
def test_one_turn_leaves_the_axis_of_the_turn_unknown(good, pick, axis, turn):
    k = np.arange(len(good))
    one = pick(good, (k < 500) | ((k >= turn[0]) & (k < turn[1])))
    one = replace(one, t=0.02 * np.arange(len(one)), flat=(0, 500))
    result = judged(one)
    assert result.verdict == "refused"
    assert f"{axis} up" in result.reasons["few_orientations"]
    assert "hold the board still in more orientations" in result.reasons["few_orientations"]
    # Unknown directions are no fault of the sensor.
    assert result.reasons.keys() <= {"few_orientations", "not_converged"}


def test_six_faces_by_hand_are_usable(hand):
    result = judged(hand(0, "pose6").recording)
    assert result.verdict == "usable"
    assert "few_orientations" in result.reasons


def test_a_useless_uncertainty_is_refused_whichever_estimate_set_it(hand):
    evidence, _ = estimate(hand(0, "pose6").recording, "auto", G)
    wide = 1.0 / evidence.uncertainty.rms_mps2
    claim = replace(evidence.claim, floored=wide * evidence.claim.model)
    quality = judge(
        replace(evidence, claim=claim, fit=replace(evidence.fit, covariance=wide**2 * evidence.fit.covariance))
    )
    assert quality["verdict"] == "refused"
    assert "known to 1 m/s^2" in quality["reasons"][0]["message"]


@pytest.mark.parametrize("degrees_a_second", [125, 250])
def test_a_clipped_gyroscope_is_named(hand, degrees_a_second):
    recording = hand(3, "pose12").recording
    limit = np.deg2rad(degrees_a_second)
    factor = degrees_a_second / 125  # as fast a hand as the range is wide
    faster = replace(recording, t=recording.t / factor, gyr=recording.gyr * factor)
    clipped = replace(faster, gyr=np.clip(faster.gyr, -limit, limit))
    count = int((np.abs(clipped.gyr) == limit).any(1).sum())
    result = judged(clipped)
    assert result.verdict != "good"
    assert f"{count} samples" in result.reasons["gyro_clipped"]
    assert "turn more slowly" in result.reasons["gyro_clipped"]


def test_turns_beyond_the_range_do_not_blame_the_gyroscope(hand):
    recording = hand(3, "pose12").recording
    limit = np.deg2rad(60)
    result = judged(replace(recording, gyr=np.clip(recording.gyr, -limit, limit)))
    assert result.verdict == "usable"
    assert list(result.reasons) == ["gyro_clipped"]
    assert "estimated from the rests alone" in result.reasons["gyro_clipped"]
    assert "choose a larger --gyro-range" in result.reasons["gyro_clipped"]


def test_a_clipped_accelerometer_is_named(good):
    acc = good.acc.copy()
    acc[[700, 901, 1102], 0] = 2 * 9.80665  # knocks
    result = judged(replace(good, acc=acc))
    assert result.verdict == "usable"
    assert list(result.reasons) == ["accel_clipped"]
    assert "in 3 samples" in result.reasons["accel_clipped"]
    assert "move more gently" in result.reasons["accel_clipped"]


def test_a_range_that_is_too_small_for_gravity_is_refused(ideal):
    recording = ideal(0, D=2.1 * np.eye(3)).recording
    limit = 2 * 9.80665
    result = judged(replace(recording, acc=np.clip(recording.acc, -limit, limit)))
    assert result.verdict == "refused"
    assert "choose a larger range" in result.reasons["accel_clipped"]


@pytest.mark.parametrize(("chip", "remedy"), [("MPU-6050", "use a faster bus"), (None, "let what records it keep up")])
def test_lost_samples_are_counted_and_mended(ideal, pick, chip, remedy):
    """A foreign file says nothing of the bus that it comes from."""
    simulated = ideal(0)
    kept = np.ones(len(simulated.recording), bool)
    kept[700:710] = kept[1100:1130] = False
    part = pick(simulated.recording, kept)
    result = judged(replace(part, sensor=replace(part.sensor, chip=chip)))
    assert result.verdict == "usable"
    assert "in 2 places (0.84 s in all)" in result.reasons["data_lost"]
    assert f"interrupted there, {remedy}" in result.reasons["data_lost"]


def test_refusing_reasons_come_first(ideal, pick):
    recording = ideal(0).recording
    kept = np.ones(len(recording), bool)
    kept[700:710] = False
    result = judged(pick(replace(recording, acc=recording.acc * mirrored("z")), kept))
    assert result.verdict == "refused"
    assert list(result.reasons) == ["left_handed", "data_lost"]


def test_a_recording_that_is_mostly_lost_is_refused(good, pick):
    kept = np.ones(len(good), bool)
    kept[600:1900] = False
    assert judged(pick(good, kept)).verdict == "refused"


@pytest.mark.parametrize("motion", ["bench", "hand"])
@pytest.mark.parametrize("axis", "xyz")
def test_a_mirrored_axis_is_named(good, in_hand, axis, motion):
    recording = good if motion == "bench" else in_hand.recording
    spoilt = replace(recording, acc=recording.acc * mirrored(axis))
    refused_for("left_handed", spoilt, f"change the sign of its {axis} axis")


@pytest.mark.parametrize("axis", "xyz")
def test_two_mirrored_axes_are_named_so_that_the_flat_board_reads_up(in_hand, axis):
    """Mirror two axes, as of an FRD accelerometer and an FLU gyroscope: changing x would turn gravity upside down."""
    recording = replace(in_hand.recording, acc=-in_hand.recording.acc * mirrored(axis))
    names = " and ".join(name for name in "xyz" if name != axis)
    refused_for("left_handed", recording, f"the sign of its {names} axes, or of its {axis} axis where")


@pytest.mark.parametrize("named", ["z, y, x", "y, z, x", "y, -x, z"])
def test_swapped_axes_are_named(good, named):
    axes = named.split(", ")
    order, signs = ["xyz".index(axis[-1]) for axis in axes], [-1.0 if axis[0] == "-" else 1.0 for axis in axes]
    refused_for("swapped_axes", replace(good, acc=signs * good.acc[:, order]), f"along the gyroscope's {named};")


def test_axes_askew_by_30_degrees_are_legitimate():
    for seed in range(4):
        reasons = judged(paper_scenario(seed, rate_hz=50).recording).reasons
        assert reasons.keys().isdisjoint({"left_handed", "swapped_axes", "wrong_range"})


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_wrong_range_is_named(ideal, factor):
    recording = ideal(0, D=factor * np.diag([0.98, 1.01, 1.03]), rate_hz=100).recording
    refused_for("wrong_range", recording, f"near {factor:g}", "give the true range")
    assert judged(replace(recording, acc=recording.acc / factor)).verdict == "good", "the remedy helps"


@pytest.mark.parametrize(("factor", "said"), [(3.28, "near 3.2"), (0.305, "near 0.3")], ids=str)
def test_a_factor_that_is_no_range_is_named(ideal, factor, said):
    recording = ideal(0).recording
    refused_for("units_suspect", replace(recording, acc=recording.acc * factor), said, "convert it")


@pytest.mark.parametrize("factor", [1.3, 0.75])
def test_gains_with_one_common_error_are_reported(ideal, factor):
    recording = ideal(0).recording
    result = judged(replace(recording, acc=recording.acc * factor))
    assert (result.verdict, list(result.reasons)) == ("usable", ["units_suspect"])
    assert "data sheets allow 3 %" in result.reasons["units_suspect"]


@pytest.mark.parametrize("gains", [(0.5, 1.0, 1.5), (0.5, 0.5, 0.6), (1.05, 1.05, 1.05)], ids=str)
def test_gains_that_are_no_power_of_two_are_legitimate(ideal, gains):
    assert judged(ideal(0, D=np.diag(gains), rate_hz=100).recording) == Judged("good", {})


@pytest.mark.parametrize("axis", [0, 1, 2], ids="xyz")
def test_a_board_that_moved_while_it_should_lie(good, axis):
    acc = good.acc.copy()
    acc[250:500, axis] += 2.0
    result = judged(replace(good, acc=acc))
    assert result.verdict == "refused"
    assert f"({'xyz'[axis]} changed by 2 m/s^2" in result.reasons["moved_while_still"]
    assert "take the hands off" in result.reasons["moved_while_still"]


def test_a_flat_part_that_is_found_leaves_out_where_it_moved(good):
    acc = good.acc.copy()
    acc[:50, 1] += 0.8
    assert "moved_while_still" not in judged(replace(good, acc=acc, flat=None)).reasons


@pytest.mark.parametrize("axis", [0, 1, 2], ids="xyz")
def test_a_gyroscope_beyond_its_data_sheet_is_named(hand, axis):
    recording = hand(3, "pose12").recording
    scale = np.ones(3)
    scale[axis] = 1 / 1.2
    result = judged(replace(recording, gyr=recording.gyr * scale))
    assert result.verdict == "usable"
    assert list(result.reasons) == ["gyro_off"]
    assert f"% on {'xyz'[axis]} " in result.reasons["gyro_off"]
    off = float(result.reasons["gyro_off"].split("scale factor error is ")[1].split("%")[0])
    assert off == pytest.approx(20.0, abs=4.0)
    assert "check its range and the sample rate" in result.reasons["gyro_off"]


@pytest.mark.parametrize(("to", "verdict"), [(23.0, "good"), (32.0, "usable")])
def test_warming_up_is_named(good, to, verdict):
    warming = replace(good, temperature_c=np.linspace(20.0, to, len(good)))
    result = judged(warming)
    assert result.verdict == verdict
    assert ("temperature_moved" in result.reasons) == (verdict == "usable")
    if verdict == "usable":
        assert "from 20.2 to 31.8 C" in result.reasons["temperature_moved"]
        assert "warm up first" in result.reasons["temperature_moved"]


def test_a_vehicle_that_heats_its_imu_is_left_to_be_warm(good):
    sensor = replace(good.sensor, message="HIGHRES_IMU")
    result = judged(replace(good, sensor=sensor, temperature_c=np.linspace(20.0, 32.0, len(good))))
    assert "BRD_HEAT_TARG of ArduPilot" in result.reasons["temperature_moved"]


def test_one_glitch_of_the_thermometer_is_no_warming(good):
    temperature = np.full(len(good), 25.0)
    temperature[7] = 90.0
    assert judged(replace(good, temperature_c=temperature)).verdict == "good"


def test_algorithm_1_does_not_always_settle():
    recording = paper_scenario(17, rate_hz=10).recording
    result = judged(recording, "paper")
    assert result.verdict == "refused"
    assert "iterations" in result.reasons["not_converged"]
    assert "record again" in result.reasons["not_converged"]
    assert "not_converged" not in judged(recording, "accel").reasons


@pytest.mark.parametrize("model", ["accel", "imu"])
def test_a_hand_is_inconsistent_with_a_model_that_knows_none(in_hand, model):
    result = judged(in_hand.recording, model)
    assert result.verdict == "refused"
    assert list(result.reasons) == ["inconsistent"]
    assert "expected 3" in result.reasons["inconsistent"]
    assert "--model hand" in result.reasons["inconsistent"]


def test_rates_of_other_turns_are_blamed_on_the_gyroscope(in_hand):
    recording = in_hand.recording
    gyr = np.concatenate([recording.gyr[:1000], recording.gyr[1000:][::-1]])
    result = judged(replace(recording, gyr=gyr))
    assert result.verdict == "usable"
    assert (
        "from where the gyroscope's rates lead it: D and b_a are estimated from the rests" in result.reasons["gyro_off"]
    )


def test_a_mount_that_slips_while_it_is_turned(hand):
    recording = hand(2, "continuous").recording
    assert "inconsistent" not in judged(recording).reasons
    half = len(recording) * 6 // 10
    slipped = recording.acc[half:] @ rotation(np.radians([2.0, -5.0, 2.0])).T
    result = judged(replace(recording, acc=np.concatenate([recording.acc[:half], slipped])))
    assert result.verdict != "good"
    assert "the sensor was not the same before" in result.reasons["inconsistent"]
    assert "fasten it" in result.reasons["inconsistent"]


def test_a_bias_that_steps_while_the_board_is_turned(in_hand):
    recording = in_hand.recording
    at = len(recording) // 2
    acc = recording.acc.copy()
    acc[at:] += [0.03, -0.05, 0.03]
    result = judged(replace(recording, acc=acc))
    assert result.verdict != "good"
    said = result.reasons["zero_moved"]
    size, begin, end = (float(number) for number in re.findall(r"[\d.]+", said)[:3])
    assert 3.0 < size < 12.0  # of 6.7 mg
    assert begin - 3.0 < recording.t[at] - recording.t[0] < end + 3.0


def test_a_gyroscopes_bias_that_steps_is_followed(hand):
    made = hand(2, "continuous")
    recording, at = made.recording, len(made.recording) * 6 // 10
    gyr = recording.gyr.copy()
    gyr[at:] += np.radians([2.0, 1.0, -2.0])
    undisturbed, stepped = (calibrate(r, gravity=G) for r in (recording, replace(recording, gyr=gyr)))
    assert stepped.verdict != "refused"
    error = sph_rms(made.truth, stepped.D, stepped.b_a)
    assert error < 2.0 * sph_rms(made.truth, undisturbed.D, undisturbed.b_a) + 0.02
    assert error < 3.0 * stepped.quality["error_std"]["rms"]


def test_a_motor_that_starts_is_named(in_hand):
    recording = in_hand.recording
    acc = recording.acc.copy()
    acc[2500:] += np.random.default_rng(1).normal(0.0, 1.0, (len(acc) - 2500, 3))
    result = judged(replace(recording, acc=acc))
    assert result.verdict != "good"
    assert "vibration" in result.reasons["vibrating"]


def test_clipping_is_not_reported_as_a_slip(hand):
    recording = hand(2, "continuous").recording
    acc = recording.acc.copy()
    acc[3000:] += [0.15, -0.25, 0.15]
    clipped = np.zeros(len(acc), bool)
    clipped[2000:2003] = True
    assert list(judged(replace(recording, acc=acc, acc_clipped=clipped)).reasons) == ["accel_clipped"]


@pytest.mark.parametrize(
    "spoilt", [{"D": np.diag([1.0, 1.0, 0.0])}, {"covariance": np.full((HAND, HAND), np.nan)}], ids=list
)
def test_an_estimate_without_a_usable_covariance_is_refused(in_hand, spoilt):
    evidence, _ = estimate(in_hand.recording, "hand", G)
    quality = judge(replace(evidence, fit=replace(evidence.fit, **spoilt)))
    assert quality["verdict"] == "refused"
    assert "few_orientations" in [reason["code"] for reason in quality["reasons"]]


# ---- real recordings


def test_a_real_gyroscope_that_clipped_is_named(real):
    result = judged(real("mpu6050_session"))
    assert result.verdict == "usable"
    assert "18 samples" in result.reasons["gyro_clipped"]


def test_a_real_board_that_lay_still_is_not_calibrated(real):
    refused_for("few_orientations", real("mpu6050_static"), "hardly turned")


def test_a_mirrored_axis_of_a_real_sensor_is_named(real):
    recording = real("mpu9150_a").part(0, 9000)
    result = judged(replace(recording, acc=recording.acc * mirrored("y")))
    assert result.verdict == "refused"
    assert "sign of its y axis" in result.reasons["left_handed"]


def test_real_rates_in_degrees(real):
    recording = real("mpu9150_b")
    refused_for("units_suspect", replace(recording, gyr=np.rad2deg(recording.gyr)), "in deg/s;")


def test_missing_rates_drawn_as_a_line_are_lost_data(real):
    recording = real("mpu9150_a")
    gyr = recording.gyr.copy()
    first = 5000
    share = np.linspace(0.0, 1.0, 1200)[:, None]
    gyr[first : first + 1200] = (1.0 - share) * gyr[first] + share * gyr[first + 1200]
    plain, spoilt = calibrate(recording, "auto", 9.81), calibrate(replace(recording, gyr=gyr), "auto", 9.81)
    assert plain.verdict == "good"
    assert spoilt.verdict == "usable"
    assert [reason["code"] for reason in spoilt.quality["reasons"]] == ["data_lost"]
    assert "1 place (11.9" in spoilt.quality["reasons"][0]["message"]
    np.testing.assert_allclose(spoilt.D, plain.D, atol=0.003)
    np.testing.assert_allclose(spoilt.b_a, plain.b_a, atol=0.02)


# ---- the gravity of the calibration


@pytest.mark.parametrize(
    ("gravity", "unlikely"), [(9.2, True), (9.755, True), (9.765, False), (9.835, False), (9.845, True)]
)
def test_a_gravity_not_found_on_earth_is_reported_unless_it_is_confirmed(good, gravity, unlikely):
    said = calibrate(good, "accel", gravity).quality
    assert [reason["code"] for reason in said["reasons"]] == ["gravity_unlikely"] * unlikely
    assert said["verdict"] == ("usable" if unlikely else "good")
    confirmed = calibrate(good, "accel", gravity, gravity_anyway=True)
    assert (confirmed.quality["verdict"], confirmed.quality["reasons"]) == ("good", [])


def test_a_sensor_that_changed_at_the_only_rest_is_refused(hand):
    # The board lies for 25 s, and is never still again.
    turned = hand(3, "continuous").recording
    indices = np.concatenate([np.arange(1500) % 500, np.arange(len(turned))])
    lying = Recording.from_arrays(0.01 * np.arange(len(indices)), turned.acc[indices], turned.gyr[indices])
    assert "inconsistent" not in judged(lying).reasons
    stepped = judged(replace(lying, acc=lying.acc - np.outer(lying.t > 8.0, (0.0, 0.0, 2.0))))
    assert stepped.verdict == "refused"
    assert "from 8 to 9 s contradicts the rest" in stepped.reasons["inconsistent"]


def test_shaking_that_follows_and_clips_is_left_out(hand):
    calm = hand(4, "pose12").recording
    rng = np.random.default_rng(4)
    n = 1000
    shaking = np.cumsum(rng.normal(0.0, 1.0, (n, 3)), axis=0)
    end = calm.t[-1] + 0.01 * (1 + np.arange(n))
    limit = np.radians(500.0)
    recording = Recording.from_arrays(
        np.concatenate([calm.t, end]),
        np.concatenate([calm.acc, calm.acc[-1] + 2.0 * shaking]),
        np.concatenate([calm.gyr, np.clip(shaking, -limit, limit)]),
    )
    assert (np.abs(recording.gyr) >= limit).any()
    clipped = replace(recording, gyr_clipped=(np.abs(recording.gyr) >= limit).any(1))
    calibration = calibrate(clipped, "auto", G)
    assert calibration.quality["verdict"] == "good"
    assert "what follows" in calibration.fit["why"]
    alone = calibrate(calm, "auto", G)
    assert np.abs((calibration.D - alone.D) / alone.D_std).max() < 1.0
