"""Checks of an estimate: a constructed recording for each fault, its verdict, reason, and the words of the sentence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal import load
from mpucal.calibration import calibrate, estimate, paper
from mpucal.calibration.parameters import HAND
from mpucal.calibration.quality import judge
from mpucal.calibration.rotation import rotation
from mpucal.data import STANDARD_GRAVITY_MPS2, Recording
from mpucal.result.calibration import Calibration
from tools.lab.scenarios.recordings import paper_scenario

G = 9.82
SESSION = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"


def judged(recording, model="auto"):
    """Return the verdict, and the sentences {code: sentence} of its reasons in their order."""
    quality = calibrate(recording, model, G).quality
    reasons = {reason["code"]: reason["message"] for reason in quality["reasons"]}
    for reason in quality["reasons"]:
        assert reason["message"].endswith(f"; {reason['remedy']}")
    assert len(reasons) == len(quality["reasons"]), "a code came twice"
    for sentence in reasons.values():
        assert "nan" not in sentence.split()
        assert not sentence.endswith(".")
    return quality["verdict"], reasons


@pytest.fixture(scope="module")
def bases(ideal, hand, in_hand):
    """Return recordings without a fault, by name, of which each row below spoils one."""
    return {
        "bench": ideal(0).recording,
        "hand": in_hand.recording,
        "pose12": hand(3, "pose12").recording,
        "continuous": hand(2, "continuous").recording,
        "turns": hand(1, "turns").recording,
        "half": ideal(0, D=0.5 * np.diag([0.98, 1.01, 1.03]), rate_hz=100).recording,
        "gains": ideal(0, D=np.diag([0.5, 0.5, 0.6]), rate_hz=100).recording,
        "heavy": ideal(0, D=2.1 * np.eye(3)).recording,
    }


def changed(acc=None, gyr=None, **fields):
    """Return a function that changes the accelerations, the rates and fields of a recording."""

    def spoil(r):
        values = {name: of(getattr(r, name).copy()) for name, of in (("acc", acc), ("gyr", gyr)) if of is not None}
        return replace(r, **values, **{name: of(r) if callable(of) else of for name, of in fields.items()})

    return spoil


def put(rows, axis, value):
    """Return a function that puts a value, or that of the first of these rows, into an axis of them."""

    def of(values):
        values[rows, axis] = values[rows, axis][0] if value is None else value
        return values

    return of


def plus(rows, value):
    """Return a function that adds a value to rows."""

    def of(values):
        values[rows] += value
        return values

    return of


def noisy(size, rows=slice(None)):
    return lambda values: plus(rows, np.random.default_rng(1).normal(0.0, size, values[rows].shape))(values)


def sensor(**fields):
    return lambda r: replace(r.sensor, **fields)


def only_gravity(acc):
    return G * acc / np.linalg.norm(acc, axis=1, keepdims=True)


def followed(r):
    """Return the recording with gravity as a filter of a second follows it, by the gyroscope and the accelerometer."""
    v, acc, share = r.acc[0], r.acc.copy(), 1.0 / r.rate_hz
    for k, (a, turn) in enumerate(zip(r.acc, (r.gyr - r.gyr[:500].mean(0)) * share, strict=True)):
        v = v - np.cross(turn, v)
        v = acc[k] = v + share * (a - v)
    return replace(r, acc=acc)


def last_at_rest(r):
    """Return a recording that ends with its rest; the turn about the vertical before it looks like another rest."""
    return Recording.from_arrays(r.t, np.roll(r.acc, -500, axis=0), np.roll(r.gyr, -500, axis=0))


def without(*spans):
    """Return a function that leaves out samples, and the known flat segment."""

    def spoil(r):
        lost = np.concatenate([np.arange(*span) for span in spans])
        columns = (np.delete(values, lost, axis=0) for values in (r.t, r.acc, r.gyr))
        return replace(Recording.from_arrays(*columns), sensor=r.sensor)

    return spoil


# A name: the base, how it is spoilt, the code, and words of the sentence. Those of MORE have further reasons.
MORE = {"swapped midway", "swapped early", "beyond the range", "moved", "lost", "other turns", "followed gravity"}
REFUSED = {
    "shaken": ("bench", changed(gyr=noisy(0.5), flat=None), "never_still", "never lay still", "for ten seconds"),
    "turned at once": ("bench", lambda r: replace(r.part(500, 1500), flat=None), "never_still", "never lay still"),
    "rest at the end": ("bench", last_at_rest, "never_still", "only after 20 s", "before you turn it"),
    "a short flat": ("hand", changed(flat=(0, 5)), "never_still", "samples 0 to 4, is too short", "leave it out"),
    "only lying": ("bench", lambda r: r.part(0, 520), "few_orientations", "hardly turned", "each of its sides"),
    "on a table": (
        "hand",
        changed(lambda acc: np.tile(acc[:1000], (5, 1)), lambda gyr: noisy(0.01)(gyr * [0.0, 0.0, 1.0])),
        "few_orientations",
        "hardly turned",
    ),
    "in g": ("bench", changed(lambda acc: acc / 9.80665), "units_suspect", "in g;", "convert it to m/s^2"),
    "in a tiny unit": ("hand", changed(lambda acc: acc / 1e3), "units_suspect", "in a unit about", "times as large"),
    "in ms": ("bench", changed(t=lambda r: 1e3 * r.t), "units_suspect", "in milliseconds", "convert them to seconds"),
    "in deg/s": ("bench", changed(gyr=np.rad2deg), "units_suspect", "in deg/s;", "convert it to rad/s", "gyroscope"),
    "noisy deg/s": ("hand", changed(gyr=lambda gyr: noisy(5.0)(np.rad2deg(gyr)), flat=None), "units_suspect", "deg/s;"),
    "metres converted from g": ("hand", changed(acc=lambda acc: acc * G), "units_suspect", "say --units acc=m/s^2"),
    "rates in counts": ("hand", changed(gyr=lambda gyr: np.rad2deg(gyr) * 131.0), "units_suspect", "in raw counts;"),
    "a factor": ("bench", changed(lambda acc: 3.28 * acc), "units_suspect", "near 3.2", "convert it"),
    "another range": ("half", lambda r: r, "wrong_range", "near 0.5", "give the true range"),
    "beyond the range": (
        "heavy",
        changed(lambda acc: np.clip(acc, -19.6133, 19.6133)),
        "accel_clipped",
        "choose a larger range",
    ),
    "no rates": ("bench", changed(gyr=np.zeros_like), "gyro_off", "x and y and z", "wiring"),
    "a dead rate": ("bench", changed(gyr=put(slice(None), 1, None)), "gyro_off", "the same on y in every"),
    "a dead axis": ("bench", changed(put(slice(None), 1, None)), "bits_stuck", "the same on y in every"),
    "stuck for 4 s": ("hand", changed(put(slice(1900, 2300), 2, None)), "bits_stuck", "on z from 19 to 23 s, though"),
    "gravity alone": ("hand", changed(only_gravity), "not_raw", "stays within", "raw accelerometer"),
    "followed gravity": ("pose12", followed, "not_raw", "no hand moves so smoothly", "raw accelerometer"),
    "two sensors": ("hand", changed(plus(slice(None, None, 2), 0.1)), "not_raw", "every other reading", "--sensor"),
    "no gravity": ("hand", changed(lambda acc: 0.3 * (acc - only_gravity(acc))), "not_raw", "no gravity in it"),
    "few rests at a half": ("turns", changed(gyr=lambda gyr: 0.25 * gyr), "gyro_off", "4 times as", "--gyro-range"),
    "mirrored": ("bench", changed(lambda acc: acc * [1.0, -1.0, 1.0]), "left_handed", "change the sign of its y axis"),
    # of an FRD accelerometer and an FLU gyroscope: changing x would turn gravity upside down
    "two mirrored": (
        "hand",
        changed(lambda acc: acc * [-1.0, 1.0, -1.0]),
        "left_handed",
        "the sign of its x and z axes, or of its y axis where",
    ),
    "swapped": ("bench", changed(lambda acc: acc[:, [1, 0, 2]] * [1, -1, 1]), "swapped_axes", "gyroscope's y, -x, z;"),
    "swapped midway": (
        "hand",
        changed(lambda acc: np.concatenate([acc[:2400], acc[2400:, [1, 0, 2]]])),
        "inconsistent",
        "not the same before",
    ),
    "swapped early": (
        "hand",
        changed(lambda acc: np.concatenate([acc[:1444], acc[1444:, [1, 2, 0]]])),
        "inconsistent",
        "not the same before 10 s and after 15 s",
    ),
    "moved": ("bench", changed(plus(slice(250, 500), [0, 2.0, 0])), "moved_while_still", "(y changed by 2 m/s^2"),
    "lost": ("bench", without((600, 1900)), "data_lost", "place"),
    "axes of the room": (
        "hand",
        changed(lambda acc: acc[:500].mean(0) + 0.1 * (acc - acc.mean(0)) / np.linalg.norm(acc, axis=1)[:, None]),
        "not_raw",
        "although the rates turn the board by up to 1",
    ),
}
USABLE = {
    "knocks": (
        "bench",
        changed(put([700, 901, 1102], 0, 2 * 9.80665)),
        "accel_clipped",
        "in 3 samples",
        "move more gently",
    ),
    "lost by a bus": (
        "bench",
        lambda r: without((700, 710), (1100, 1130))(replace(r, sensor=replace(r.sensor, chip="MPU-6050"))),
        "data_lost",
        "in 2 places (0.84 s in all)",
        "use a faster bus",
    ),
    # the bus of another program's file is unknown
    "lost in a file": ("bench", without((700, 710)), "data_lost", "in 1 place (", "let what records it keep up"),
    "zeros": ("pose12", changed(*2 * [put(slice(900, None, 211), slice(3), 0.0)]), "data_lost", "places"),
    "frozen in a rest": ("hand", changed(*2 * [put(slice(1950, 2300), slice(3), None)]), "data_lost", "in 1 place ("),
    "rates that begin late": ("pose12", changed(gyr=put(slice(250), slice(3), 0.0), flat=None), "data_lost", "1 place"),
    "coarse": ("pose12", changed(lambda acc: 0.15 * np.rint(acc / 0.15)), "inconsistent", "in steps of 0.15 m/s^2"),
    "gains alike": ("bench", changed(lambda acc: 1.3 * acc), "units_suspect", "data sheets allow 3 %"),
    "warming": (
        "bench",
        changed(temperature_c=lambda r: np.linspace(20.0, 32.0, len(r))),
        "temperature_moved",
        "from 20.2 to 31.8 C",
        "warm up first",
    ),
    "a heated IMU": (
        "bench",
        changed(temperature_c=lambda r: np.linspace(20.0, 32.0, len(r)), sensor=sensor(message="HIGHRES_IMU")),
        "temperature_moved",
        "BRD_HEAT_TARG of ArduPilot",
    ),
    "a gain of the gyroscope": (
        "pose12",
        changed(gyr=lambda gyr: gyr / [1.0, 1.2, 1.0]),
        "gyro_off",
        "% on y ",
        "check the sample rate",
    ),
    "clipped turns": (
        "pose12",
        changed(gyr=lambda gyr: np.clip(gyr, -2.18166, 2.18166)),
        "gyro_clipped",
        "turn more slowly",
    ),
    "clipped, and no slip": (
        "continuous",
        changed(plus(slice(3000, None), [0.15, -0.25, 0.15]), acc_clipped=lambda r: np.arange(len(r)) // 3 == 700),
        "accel_clipped",
    ),
    "a fast clock": ("bench", changed(sensor=sensor(clock_ppm=5e3, clock_std=2e-5)), "clock_off", "runs +5000 ppm"),
    "an unknown clock": ("bench", changed(sensor=sensor(clock_ppm=0.0, clock_std=0.01)), "clock_off", "10000 ppm"),
}
OF_RESTS = {
    "half": ("hand", changed(gyr=lambda gyr: 2.0 * gyr), "gyro_off", "0.5 times as far as the gyroscope says"),
    "a known range": (
        "hand",
        changed(gyr=lambda gyr: 0.5 * gyr, sensor=sensor(gyro_range_dps=250.0, message="a log")),
        "gyro_off",
        "than assumed: ±500 deg/s, read as ±250",
    ),
    "other turns": (
        "hand",
        changed(gyr=lambda gyr: np.concatenate([gyr[:1000], gyr[1000:][::-1]])),
        "gyro_off",
        "from where the gyroscope's rates lead it",
    ),
    "exchanged in both": (
        "pose12",
        changed(lambda acc: acc[:, [1, 0, 2]], lambda gyr: gyr[:, [1, 0, 2]]),
        "left_handed",
        "the axes of both sensors are left-handed",
    ),
    "a late accelerometer": (
        "pose12",
        changed(lambda acc: acc[np.maximum(np.arange(len(acc)) - 40, 0)]),
        "clock_off",
        "lags behind the gyroscope by",
    ),
    "far beyond its range": (
        "pose12",
        changed(gyr=lambda gyr: np.clip(gyr, -1.0472, 1.0472)),
        "gyro_clipped",
        "choose a larger --gyro-range",
    ),
}
GOOD = {
    "bench": ("bench", lambda r: r),
    "a part left out on purpose": ("bench", lambda r: r.without({700: 730})),
    "a flat that is found": ("bench", changed(flat=None)),
    "hand": ("hand", lambda r: r),
    "its range mended": ("half", changed(lambda acc: 2.0 * acc)),
    "gains of no power of two": ("gains", lambda r: r),
    "a little warmer": ("bench", changed(temperature_c=lambda r: np.linspace(20.0, 23.0, len(r)))),
    "a glitch of the thermometer": ("bench", changed(temperature_c=lambda r: np.where(np.arange(len(r)) == 7, 90, 25))),
    "a clock within limits": ("bench", changed(sensor=sensor(clock_ppm=499.0, clock_std=2e-5))),
}


@pytest.mark.parametrize(
    ("verdict", "name"),
    [(verdict, name) for verdict, rows in (("refused", REFUSED), ("usable", USABLE | OF_RESTS)) for name in rows],
)
def test_a_fault_is_the_only_reason(bases, verdict, name):
    base, spoil, code, *words = (REFUSED if verdict == "refused" else USABLE | OF_RESTS)[name]
    found, reasons = judged(spoil(bases[base]))
    assert found == verdict
    assert code in reasons if name in MORE else list(reasons) == [code]
    for word in words:
        assert word in reasons[code]
    assert ("estimated from the rests alone" in reasons[code]) == (name in OF_RESTS and verdict == "usable")


@pytest.mark.parametrize("name", GOOD)
def test_a_recording_without_a_fault_is_good(bases, name):
    base, spoil = GOOD[name]
    assert judged(spoil(bases[base])) == ("good", {})


@pytest.mark.parametrize("model", ["auto", "tilt"])
def test_a_flat_segment_of_a_quarter_of_a_second_suffices(in_hand, model):
    recording = in_hand.recording
    calibration = calibrate(replace(recording, flat=(0, round(0.25 * recording.rate_hz))), model, G)
    assert np.isfinite(calibration.D).all()
    assert np.isfinite(calibration.quality["error_std"]["rms"])


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
    for rows in (slice(1900, 2050), slice(0, 900)):
        assert "bits_stuck" not in judged(changed(put(rows, 2, None))(in_hand.recording))[1]


def test_a_hand_that_trembles_as_it_turns_a_board_is_no_motor(in_hand):
    """Tremble at 12 Hz, of which a recording of 50 Hz has four samples a period."""
    r = in_hand.recording
    t, acc, gyr = (values[::2] for values in (r.t, r.acc, r.gyr))
    turns = np.linalg.norm(gyr - gyr[:400].mean(axis=0), axis=1) > 0.3
    trembles = np.convolve(turns, np.ones(35), "same") > 0
    tremor = 1.2 * np.where(trembles, np.sin(24.0 * np.pi * t), 0.0)
    assert judged(Recording.from_arrays(t, acc + tremor[:, None] * [0.6, 0.6, 0.5], gyr)) == ("good", {})


def test_two_sensors_that_take_turns_are_told_from_a_hum(in_hand):
    """A hum of nearly half the sample rate makes every other reading differ, too, but not alike in all rests."""
    recording = in_hand.recording
    other = np.arange(len(recording))[:, None] % 2
    gain, bias, drift = 1.0 + 0.02 * other, other * [0.3, -0.2, 0.4], other * [0.03, -0.02, 0.01]
    joined = replace(recording, acc=gain * recording.acc + bias, gyr=recording.gyr + drift)
    for of in (joined, joined.without({1500: 1501})):  # one sample is lost, and the sensors change places
        verdict, reasons = judged(of)
        assert verdict == "refused"
        assert "take turns" in reasons["not_raw"]
    hum = 0.2 * np.cos(2.0 * np.pi * 49.99 * recording.t)[:, None] * [0.6, 0.6, 0.5]
    assert judged(replace(recording, acc=recording.acc + hum)) == ("good", {})


def test_a_bit_that_a_hum_passes_over_as_a_recording_ends_is_not_stuck(in_hand):
    """Swing at half the sample rate by 256 counts, from one word with bit 7 to the next."""
    counts = np.rint(in_hand.recording.acc * 16384.0 / STANDARD_GRAVITY_MPS2).astype(int)
    swing = 192 + 256 * (counts[-60:, 0] // 256)
    swing[1::2] += 256
    counts[-60:, 0] = swing
    acc = counts / 16384.0 * STANDARD_GRAVITY_MPS2
    assert "bits_stuck" not in judged(replace(in_hand.recording, acc=acc))[1]


def test_one_turn_leaves_the_axis_of_the_turn_unknown(bases):
    verdict, reasons = judged(bases["bench"].part(0, 1000))
    assert verdict == "refused"
    assert "x up" in reasons["few_orientations"]
    # Unknown directions are no fault of the sensor.
    assert reasons.keys() <= {"few_orientations", "not_converged"}


def test_six_faces_by_hand_are_usable_and_refused_where_their_uncertainty_is_useless(hand):
    evidence, _ = estimate(hand(0, "pose6").recording, "auto", G)
    quality = judge(evidence)
    assert quality["verdict"] == "usable"
    assert "few_orientations" in [reason["code"] for reason in quality["reasons"]]
    wide = 1.0 / evidence.uncertainty.rms_mps2
    claim = replace(evidence.claim, floored=wide * evidence.claim.model)
    covariance = wide**2 * evidence.fit.covariance
    quality = judge(replace(evidence, claim=claim, fit=replace(evidence.fit, covariance=covariance)))
    assert quality["verdict"] == "refused"
    assert "known to 1 m/s^2" in quality["reasons"][0]["message"]


def test_refusing_reasons_come_first(bases):
    recording = bases["bench"]
    spoilt = without((700, 710))(replace(recording, acc=recording.acc * [1.0, 1.0, -1.0]))
    verdict, reasons = judged(spoilt)
    assert (verdict, list(reasons)) == ("refused", ["left_handed", "data_lost"])


def test_an_estimate_that_has_not_settled_is_refused(monkeypatch):
    monkeypatch.setattr(paper, "MAX_ITERATIONS", 2)
    recording = paper_scenario(17, rate_hz=10).recording
    verdict, reasons = judged(recording, "paper")
    assert verdict == "refused"
    assert "iterations" in reasons["not_converged"]
    assert "not_converged" not in judged(recording, "accel")[1]


def test_a_hand_is_inconsistent_with_a_model_that_knows_none(in_hand):
    verdict, reasons = judged(in_hand.recording, "imu")
    assert (verdict, list(reasons)) == ("refused", ["inconsistent"])
    assert "expected 3" in reasons["inconsistent"]
    assert "--model hand" in reasons["inconsistent"]


# ---- a sensor that changes while it is measured


def test_a_mount_that_slips_while_it_is_turned(bases):
    recording = bases["continuous"]
    half = len(recording) * 6 // 10
    slipped = recording.acc[half:] @ rotation(np.radians([2.0, -5.0, 2.0])).T
    verdict, reasons = judged(replace(recording, acc=np.concatenate([recording.acc[:half], slipped])))
    assert verdict != "good"
    assert "the sensor was not the same before" in reasons["inconsistent"]
    assert "fasten it" in reasons["inconsistent"]


def test_a_motor_that_starts_is_named(in_hand):
    verdict, reasons = judged(changed(noisy(1.0, slice(2500, None)))(in_hand.recording))
    assert verdict != "good"
    assert "vibration" in reasons["vibrating"]


@pytest.mark.parametrize("seed", [3, 4])
def test_ground_that_moves_is_no_lack_of_orientations(hand, seed):
    """A board on twelve of its sides and corners, on ground whose acceleration of 0.1 m/s^2 changes every 2 s."""
    calm = hand(seed, "pose12").recording
    at = np.arange(calm.t[0] + 12.0, calm.t[-1], 2.0)
    sway = np.random.default_rng(seed).normal(0.0, 0.1, (len(at), 3))
    moved = replace(calm, acc=calm.acc + np.stack([np.interp(calm.t, at, axis, left=0.0) for axis in sway.T], axis=1))
    verdict, reasons = judged(moved)
    assert (verdict, list(reasons)) == ("usable", ["inconsistent"])
    assert "on all of its sides" in reasons["inconsistent"]
    assert "in a vehicle or a lift" in reasons["inconsistent"]


@pytest.mark.parametrize(("seed", "poses"), [(3, "pose12"), (1, "pose6")])
def test_more_orientations_are_not_asked_for_where_a_knock_moved_the_bias(hand, seed, poses):
    calm = hand(seed, poses).recording
    knocked = calm.t - calm.t[0] > 20.0
    _, reasons = judged(replace(calm, acc=calm.acc + np.outer(knocked, (0.4, -0.2, 0.1))))
    assert "accelerometer's bias" in reasons["zero_moved"]
    assert "few_orientations" not in reasons


def test_a_slip_that_leads_the_fit_astray_is_named(hand):
    calm = hand(1, "pose12").recording
    slipped = np.where(
        calm.t[:, None] > calm.t[0] + 28.0, calm.acc @ rotation(np.array([0.1, 0.08, -0.06])).T, calm.acc
    )
    verdict, reasons = judged(replace(calm, acc=slipped))
    assert (verdict, list(reasons)) == ("refused", ["inconsistent"])
    assert "not the same before 28 s and after 30 s" in reasons["inconsistent"]


def test_a_sensor_that_changed_at_the_only_rest_is_refused(hand):
    # The board lies for 25 s, and is never still again.
    turned = hand(1, "continuous").recording
    indices = np.concatenate([np.arange(1500) % 500, np.arange(len(turned))])
    lying = Recording.from_arrays(0.01 * np.arange(len(indices)), turned.acc[indices], turned.gyr[indices])
    verdict, reasons = judged(replace(lying, acc=lying.acc - np.outer(lying.t > 8.0, (0.0, 0.0, 2.0))))
    assert verdict == "refused"
    assert "from 8 to 9 s contradicts the rest" in reasons["inconsistent"]


def test_shaking_that_follows_and_clips_is_left_out(hand):
    calm = hand(4, "pose12").recording
    shaking = np.cumsum(np.random.default_rng(4).normal(0.0, 1.0, (1000, 3)), axis=0)
    limit = np.radians(500.0)
    recording = Recording.from_arrays(
        np.concatenate([calm.t, calm.t[-1] + 0.01 * (1 + np.arange(1000))]),
        np.concatenate([calm.acc, calm.acc[-1] + 2.0 * shaking]),
        np.concatenate([calm.gyr, np.clip(shaking, -limit, limit)]),
    )
    calibration = calibrate(replace(recording, gyr_clipped=(np.abs(recording.gyr) >= limit).any(1)), "auto", G)
    assert calibration.quality["verdict"] == "good"
    assert "what follows" in calibration.fit["why"]
    alone = calibrate(calm, "auto", G)
    assert np.abs((calibration.D - alone.D) / alone.D_std).max() < 1.0


@pytest.mark.parametrize(
    "spoilt", [{"D": np.diag([1.0, 1.0, 0.0])}, {"covariance": np.full((HAND, HAND), np.nan)}], ids=list
)
def test_an_estimate_without_a_usable_covariance_is_refused(in_hand, spoilt):
    evidence, _ = estimate(in_hand.recording, "hand", G)
    quality = judge(replace(evidence, fit=replace(evidence.fit, **spoilt)))
    assert quality["verdict"] == "refused"
    assert "few_orientations" in [reason["code"] for reason in quality["reasons"]]


# ---- the clock


def test_a_model_that_trusts_the_gyroscope_takes_the_clocks_error(bases):
    unknown = changed(sensor=sensor(clock_ppm=0.0, clock_std=0.01))(bases["bench"])
    assert "the model accel takes" in judged(unknown, "accel")[1]["clock_off"]


def test_the_clocks_uncertainty_is_in_that_of_k(bases):
    plain, found = (
        calibrate(r, "imu")
        for r in (bases["bench"], changed(sensor=sensor(clock_ppm=0.0, clock_std=0.01))(bases["bench"]))
    )
    np.testing.assert_array_equal(found.K, plain.K)
    expected = np.sqrt(np.diag(plain.K_std) ** 2 + (0.01 * np.diag(plain.K)) ** 2)
    np.testing.assert_allclose(np.diag(found.K_std), expected, rtol=1e-9)


@pytest.mark.parametrize(("lag_s", "words"), [(0.03, "lags behind"), (-0.03, "runs ahead of"), (0.01, None)])
def test_a_lag_between_the_sensors_is_reported(in_hand, lag_s, words):
    recording = in_hand.recording
    acc = np.column_stack([np.interp(recording.t - lag_s, recording.t, axis) for axis in recording.acc.T])
    verdict, reasons = judged(replace(recording, acc=acc))
    assert (verdict, list(reasons)) == (("good", []) if words is None else ("usable", ["clock_off"]))
    for sentence in reasons.values():
        assert f"{words} the gyroscope by " in sentence
        assert float(sentence.split("gyroscope by ")[1].split()[0]) == pytest.approx(30, abs=3)


# ---- real recordings, and gravity


def test_missing_rates_drawn_as_a_line_are_lost_data(real):
    recording = real("mpu9150_a")
    gyr, lost, share = recording.gyr.copy(), slice(5000, 6200), np.linspace(0.0, 1.0, 1200)[:, None]
    gyr[lost] = (1.0 - share) * gyr[5000] + share * gyr[6200]
    plain, spoilt = calibrate(recording, "auto", 9.81), calibrate(replace(recording, gyr=gyr), "auto", 9.81)
    assert (plain.verdict, spoilt.verdict) == ("good", "usable")
    assert [reason["code"] for reason in spoilt.quality["reasons"]] == ["data_lost"]
    assert "1 place (11.9" in spoilt.quality["reasons"][0]["message"]
    np.testing.assert_allclose(spoilt.D, plain.D, atol=0.003)
    np.testing.assert_allclose(spoilt.b_a, plain.b_a, atol=0.02)


@pytest.mark.parametrize(("gravity", "unlikely"), [(9.755, True), (9.765, False), (9.835, False), (9.845, True)])
def test_a_gravity_not_found_on_earth_is_reported_unless_it_is_confirmed(bases, gravity, unlikely):
    said = calibrate(bases["bench"], "accel", gravity).quality
    assert [reason["code"] for reason in said["reasons"]] == ["gravity_unlikely"] * unlikely
    assert said["verdict"] == ("usable" if unlikely else "good")
    confirmed = calibrate(bases["bench"], "accel", gravity, gravity_anyway=True)
    assert (confirmed.quality["verdict"], confirmed.quality["reasons"]) == ("good", [])
