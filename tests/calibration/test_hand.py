"""Estimator for a hand, on simulated hands with a known truth, on another simulator's, and on real sensors."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.calibration.hand import fit_hand
from mpucal.calibration.interim import interim_estimate
from mpucal.calibration.next_orientation import next_orientation
from mpucal.calibration.parameters import B_A_NAMES, BY_NAME, D_NAMES, K_NAMES, NAMES
from mpucal.calibration.preprocessing import preprocess
from mpucal.calibration.theta import Theta
from mpucal.calibration.transitions import leverages, transitions_of
from mpucal.data import Recording
from mpucal.rests.flat import find_flat, flat_statistics
from mpucal.rests.intervals import RestFinder
from mpucal.simulated.sensor import SensorTruth
from tools.lab.judge import judged, sph_rms
from tools.lab.scenarios.around import Hand
from tools.lab.scenarios.course import arcs
from tools.lab.scenarios.family import drawn, simulate
from tools.lab.scenarios.recordings import SCENES
from tools.lab.scenarios.sensors import Sampling
from tools.lab.scenarios.table import FAMILIES

G = 9.82


def fitted(recording):
    return fit_hand(recording, flat_statistics(recording, recording.flat), G).honest()


def z_scores(fit, truth):
    off = np.append(fit.D - truth.D, fit.b_a - truth.b_a)
    return off / fit.std(*D_NAMES, *B_A_NAMES)


def rests(recording):
    return RestFinder(recording, flat_statistics(recording, recording.flat)).typical()


@pytest.mark.parametrize(
    ("motion", "how", "mean", "worst"),
    [
        ("pose12", {}, 0.008, 0.015),
        ("pose12", {"tremble": True}, 0.010, 0.020),
        ("continuous", {}, 0.055, 0.08),
        ("wobble100", {}, 0.20, 0.30),
        ("turns", {}, 0.12, 0.2),
        ("pose6", {}, 0.15, 0.25),
        ("calm jerks", {}, 0.005, 0.008),
    ],
    ids=lambda value: value if isinstance(value, str) else "trembling" if value == {"tremble": True} else "",
)
def test_a_sensor_in_a_hand_is_found_with_right_standard_deviations(hand, motion, how, mean, worst):
    runs = [hand(seed, motion, **how) for seed in range(2)]
    fits = [fitted(run.recording) for run in runs]
    assert all(fit.converged for fit in fits)
    off = [sph_rms(run.truth, fit.D, fit.b_a) for fit, run in zip(fits, runs, strict=True)]
    assert np.mean(off) < mean
    assert max(off) < worst
    z = [z_scores(fit, run.truth) for fit, run in zip(fits, runs, strict=True)]
    # Two runs of twelve correlated numbers show a factor of two.
    assert np.sqrt(np.mean(np.square(z))) < 1.7
    unknown = [set(fit.at_prior) & set(K_NAMES) for fit in fits]
    if motion == "pose6":
        assert all(len(names) >= 2 for names in unknown)
    if motion == "pose12":
        assert not any(unknown)
        of_k = [
            (fit.K - run.truth.K)[np.triu_indices(3)] / fit.std(*K_NAMES) for fit, run in zip(fits, runs, strict=True)
        ]
        assert np.sqrt(np.mean(np.square(of_k))) < 1.6


def test_a_model_without_a_hand_is_far_worse_and_auto_chooses_the_hands(hand):
    run = hand(1, "continuous")
    chosen, without = (calibrate(run.recording, model, G) for model in ("auto", "imu"))
    assert chosen.fit["model"] == "hand"
    assert "white noise does not explain the data" in chosen.fit["why"]
    error, other = (sph_rms(run.truth, each.D, each.b_a) for each in (chosen, without))
    assert other > 3.0 * error


def test_a_perfect_gyroscope_keeps_its_matrix_where_all_of_it_is_known(hand):
    fit = fitted(hand(0, "calm jerks", rate_hz=200).recording)
    np.testing.assert_array_equal(fit.K, np.eye(3))
    assert not set(K_NAMES) & set(fit.names)


@pytest.mark.parametrize("seed", [0, 2])
def test_the_vibration_of_a_machine_averages_out(seed):
    """Turn the board without a pause, with a motor of 17 Hz from 3 s on, whose peaks were taken for outliers."""
    made = drawn(replace(FAMILIES["quiet turntable"], motion=partial(arcs, count=10)), seed)
    r, truth = made.recording, made.truth
    t = r.t - r.t[find_flat(r)[1]]
    motor = np.sqrt(2.0) * np.clip(t - 3.0, 0.0, 1.0) * np.sin(2.0 * np.pi * 17.0 * t)
    axis = np.array([0.6, -0.64, 0.48])
    calibration = calibrate(replace(r, acc=r.acc + np.outer(motor, axis)), "auto", truth.gravity)
    assert calibration.verdict == "good"
    assert np.abs(calibration.b_a - truth.b_a).max() < 0.003
    assert judged(calibration, (truth.D, truth.b_a)).farthest < 4.0


def test_k_stays_where_two_of_its_elements_are_unknown(ideal):
    """Keep K after three turns in noise, whatever the Wald test says: D is as uncertain as its unknown elements."""
    fit = fitted(ideal(0).recording)
    assert fit.at_prior == ("K_xy", "K_zz")
    assert (fit.std(*fit.at_prior) > 0.5 * np.array(BY_NAME["K"].sd)[[1, 5]]).all()


# ---- what spoils a recording in a hand


def trembling_about_another_joint(run):
    """Compare with a hand that turns about the same joint: a common lever arm would give a bias of |omega|^2 r."""
    recording, rng = run.recording, np.random.default_rng(1)
    away = np.arange(len(recording)) >= recording.flat[1] + 50
    w = 2.0 * np.pi * rng.uniform(8.0, 12.0, (40, 3))
    phase = w * recording.t[:, None, None] + rng.uniform(0.0, 2.0 * np.pi, (40, 3))
    # The tremor has 0.5 mrad rms on each axis.
    size = 0.5e-3 * np.sqrt(2.0 / 40.0) * away[:, None]
    rate, alpha = -size * np.sum(w * np.sin(phase), axis=1), -size * np.sum(w * w * np.cos(phase), axis=1)
    return replace(recording, acc=recording.acc + np.cross(alpha, [0.05, -0.06, 0.03]), gyr=recording.gyr + rate)


def jerked(run):
    rng, acc = np.random.default_rng(0), run.recording.acc.copy()
    for start in rng.integers(1000, len(acc) - 10, 30):
        acc[start : start + 8] += rng.uniform(2, 6) * rng.choice([-1.0, 1.0], 3)
    return replace(run.recording, acc=acc)


def drifting(run):
    drift = np.deg2rad(0.3) * (1.0 - np.exp(-run.recording.t / 20.0))[:, None] * [1.0, -1.0, 0.5]
    return replace(run.recording, gyr=run.recording.gyr + drift)


@pytest.mark.parametrize(
    ("motion", "spoil", "times"),
    [("continuous", trembling_about_another_joint, 1.5), ("pose12", jerked, 3.0), ("pose12", drifting, 2.0)],
)
def test_a_tremor_jerks_and_a_drift_do_little(hand, motion, spoil, times):
    run = hand(1, motion)
    plain, spoilt = (fitted(recording) for recording in (run.recording, spoil(run)))
    assert sph_rms(run.truth, spoilt.D, spoilt.b_a) < times * sph_rms(run.truth, plain.D, plain.b_a) + 0.005


def test_a_lever_arm_turns_at_the_corrected_rates():
    """Turn a sensor on a lever of 10 to 15 cm smoothly: rates that err by 1 to 3 % leave errors of 4 to 7 mm/s^2."""
    machine = Hand(lever_m=(0.1, 0.15), sway_mps2=0.0, jerks_per_s=0.0)
    scene = replace(SCENES["continuous"], sampling=Sampling(100.0, fine_hz=400.0), hand=machine)
    for seed in range(3):
        run = simulate(scene, np.random.default_rng(seed))
        found = calibrate(run.recording, "hand", G)
        assert sph_rms(run.truth, found.D, found.b_a) < 3.5e-3, seed


@pytest.mark.parametrize("how", ["left out", "drawn as a line"])
def test_one_lost_move_changes_the_estimate_little(in_hand, pick, how):
    recording = in_hand.recording
    runs = rests(recording)
    first, last = runs[6][1], runs[7][0]
    if how == "left out":
        kept = np.ones(len(recording), bool)
        kept[first:last] = False
        spoilt = pick(recording, kept)
    else:
        gyr = recording.gyr.copy()
        gyr[first:last] = np.linspace(gyr[first], gyr[last], last - first)
        spoilt = replace(recording, gyr=gyr)
    calibration = calibrate(spoilt, "auto", G)
    assert sph_rms(in_hand.truth, calibration.D, calibration.b_a) < 0.02
    assert [reason["code"] for reason in calibration.quality["reasons"]] == ["data_lost"]


@pytest.mark.parametrize("move", [3, 6])
def test_a_move_that_the_gyroscope_did_not_see_hardly_counts(in_hand, move):
    """Start the search 57 deg wrong, by an unseen move in the middle."""
    recording = in_hand.recording
    runs, gyr, rng = rests(recording), recording.gyr.copy(), np.random.default_rng(0)
    unseen = slice(runs[move][1], runs[move + 1][0])
    gyr[unseen] = gyr[:900].mean(0) + 0.002 * rng.standard_normal((unseen.stop - unseen.start, 3))
    calibration = calibrate(replace(recording, gyr=gyr), "auto", G)
    error = sph_rms(in_hand.truth, calibration.D, calibration.b_a)
    assert calibration.verdict == "good"
    assert error < min(0.05, 3.0 * calibration.quality["error_std"]["rms"])


def test_a_miss_depends_on_the_parameters_as_its_jacobian_says(in_hand):
    """Compare the trace of J C J', for a C of one parameter's variance, with central differences of the miss."""
    prepared, truth = preprocess(in_hand.recording, in_hand.recording.flat, G), in_hand.truth
    u = in_hand.specific_force[0] / G
    theta = replace(Theta.start(truth.D, truth.b_a, prepared.flat.b_omega, u), K=truth.K)
    moves = transitions_of(prepared, theta)
    for p, name in enumerate(NAMES):
        if not name.startswith(("D_", "b_a_", "K_")):
            continue
        h = 1e-4
        C = np.zeros((len(NAMES), len(NAMES)))
        C[p, p] = 1e-4  # so small that no leverage reaches its limit of two
        ahead, behind = (
            np.array([move.miss for move in transitions_of(prepared, theta.moved(step * np.eye(len(NAMES))[p]))])
            for step in (h, -h)
        )
        wanted = 1e-4 * np.sum(((ahead - behind) / (2 * h)) ** 2, axis=1)
        given = leverages(moves, prepared, theta, C, np.ones(len(moves)))
        assert given == pytest.approx(wanted, rel=0.03, abs=1e-6), name


def test_a_diverged_estimate_still_has_a_next_orientation(in_hand):
    recording = in_hand.recording.part(0, 2000)
    known = interim_estimate(recording, flat_statistics(recording, find_flat(recording)), 9.82, None)
    diverged = replace(known, theta=replace(known.theta, u=np.full(3, np.nan)))
    assert next_orientation(diverged, np.ones(12), np.vstack([np.eye(3), -np.eye(3)])) == 0


@pytest.mark.parametrize("seed", [1, 6, 7])
def test_a_session_knows_what_its_calibration_will_say_that_it_knows(hand, seed):
    recording = hand(seed, "pose12").recording
    known = interim_estimate(recording, flat_statistics(recording, find_flat(recording)), G)
    calibration = calibrate(recording, gravity=G)
    ratios = np.append(calibration.D_std / known.D_std, calibration.b_a_std / known.b_a_std)
    assert ratios.min() > 0.9
    assert ratios.max() < 1.3


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_an_accelerometer_that_reads_zeros_at_rest_gives_no_deviations_meanwhile(in_hand):
    """A supply that fails as the board lies flat; the session goes on, and refuses the recording at its end."""
    recording = in_hand.recording
    acc = np.where(np.arange(len(recording))[:, None] < recording.flat[1], 0.0, recording.acc)
    dead = replace(recording, acc=acc)
    known = interim_estimate(dead, flat_statistics(dead, recording.flat), G)
    assert np.isnan(known.D_std).all()
    assert not known.converged


# ---- recordings of others


@pytest.mark.parametrize(("name", "limit"), [("pose12_0", 0.008), ("rot_1", 0.07), ("pose6_0", 0.25)])
def test_sensors_in_another_simulators_hands_are_found(others, name, limit):
    of = others(f"simulated/{name}")
    recording = Recording.from_arrays(of["t"], of["acc"], of["gyr"], flat=(0, int(of["flat_samples"])))
    calibration = calibrate(recording, "auto", float(of["gravity"]))
    assert calibration.fit["model"] == "hand"
    truth = SensorTruth(*(of[f"true_{key}"] for key in ("D", "b_a", "K", "b_omega")), float(of["gravity"]))
    assert sph_rms(truth, calibration.D, calibration.b_a) < limit
    assert (len(calibration.fit["at_prior"]) > 0) == (name == "pose6_0")


@pytest.mark.parametrize(("name", "median"), [("mpu9150_a", 0.02), ("mpu6050_session", 0.03), ("imucal_session", 0.05)])
def test_real_sensors_measure_gravity_once_calibrated(real, name, median):
    calibration = calibrate(real(name), "auto", 9.81)
    assert calibration.verdict != "refused"
    assert calibration.quality["magnitude_after"]["median"] == pytest.approx(9.81, abs=median)


def test_the_error_of_the_times_counts_where_the_rate_changes_and_not_at_rest(in_hand):
    recording = in_hand.recording
    late = replace(recording, sensor=replace(recording.sensor, time_std=3e-4))
    usual, prepared = (preprocess(each, recording.flat, G) for each in (recording, late))
    series = prepared.problem.series
    of_times = series.q_extra - (0.0 if usual.problem.series.q_extra is None else usual.problem.series.q_extra)
    rests = np.maximum(prepared.runs - prepared.flat.last, 0)
    assert not any(of_times[a:b].any() for a, b in rests)
    # 0.3 ms of a rate that rises to 2 or 3 rad/s and falls again are about a milliradian
    errors = [np.sqrt(of_times[span].sum()) for span in prepared.poses.spans]
    assert 2e-4 < np.median(errors) < 2e-3
    assert (prepared.poses.variance > usual.poses.variance).all()
