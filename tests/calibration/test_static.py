"""Multi-position calibration, compared with the truth and with SciPy's least squares, and on faces of a box."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from mpucal import Recording, calibrate, check
from mpucal.calibration.rotation import rotation
from mpucal.errors import UsageError
from mpucal.rests.flat import find_flat, flat_statistics
from mpucal.rests.intervals import RestFinder, statistics
from mpucal.result.comparison import compare
from mpucal.sources.opening import open_source
from tools.lab.judge import judged
from tools.lab.scenarios.recordings import hand_scenario

G = 9.82
FACES = np.vstack([np.eye(3), -np.eye(3)])


@pytest.mark.parametrize("rate", [0.0, np.nan], ids=["a dead gyroscope", "no gyroscope"])
def test_the_static_model_finds_the_truth_beside_a_faulty_gyroscope(hand, rate):
    made = hand(60, "pose12")
    calibration = calibrate(replace(made.recording, gyr=np.full_like(made.recording.gyr, rate)), "auto", G)
    assert (calibration.verdict, calibration.fit["model"]) == ("usable", "static")
    assert np.abs(judged(calibration, (made.truth.D, made.truth.b_a)).z).max() < 4.0
    assert calibration.quality["error_std"]["rms"] < 0.03
    assert np.isnan(calibration.K_std).all()


def test_the_static_model_is_an_ellipsoid_through_the_rests(hand):
    recording = hand(60, "pose12").recording
    calibration = calibrate(recording, "static", G)
    runs = RestFinder(recording, flat_statistics(recording, find_flat(recording))).typical()
    means = statistics(recording.acc, runs)[0]

    def residuals(x):
        D = np.array([[x[0], x[1], x[2]], [x[1], x[3], x[4]], [x[2], x[4], x[5]]])
        return np.linalg.norm((means - x[6:]) @ np.linalg.inv(D), axis=1) - G

    x = scipy.optimize.least_squares(residuals, [1, 0, 0, 1, 0, 1, 0, 0, 0]).x
    away = np.append(calibration.D[np.triu_indices(3)] - x[:6], calibration.b_a - x[6:])
    std = np.append(calibration.D_std[np.triu_indices(3)], calibration.b_a_std)
    assert np.abs(away / std).max() < 1.0


@pytest.mark.parametrize("seed", [1, 7, 8])
def test_rests_too_few_to_contradict_each_other_do_not_blame_the_gyroscope(hand, seed):
    """Slip by 12 deg, with a step of the bias, in the middle of nine rests, of which nine numbers fit all."""
    recording = hand(seed, "pose12").recording
    runs = RestFinder(recording, flat_statistics(recording, recording.flat)).typical()
    after = np.arange(len(recording))[:, None] > runs[4, 1] + 0.3 * recording.rate_hz
    slip = rotation(np.radians(12.0) * np.array([0.6, -0.6, 0.53]))
    acc = np.where(after, recording.acc @ slip.T + [0.15, 0.0, -0.04], recording.acc)
    calibration = calibrate(replace(recording, acc=acc).part(0, runs[8, 1]), "auto", G)
    assert calibration.fit["model"] == "hand"
    assert "gyro_off" not in {reason["code"] for reason in calibration.quality["reasons"]}
    assert calibration.quality["error_std"]["rms"] > 0.3


def test_six_faces_that_were_joined_give_biases_and_scale_factors():
    """Estimate them without the turns between the faces: with and without rates, and with the model given."""
    rng = np.random.default_rng(7)
    D, b_a = np.diag([1.04, 0.99, 0.98]), [0.66, 0.05, -0.07]  # beyond the data sheet
    n = 300
    acc = np.concatenate([G * D @ face + b_a + rng.normal(0.0, 0.03, (n, 3)) for face in FACES[[5, *range(5)]]])
    gyr = rng.normal(0.0, 0.002, acc.shape)
    t = 0.01 * np.arange(len(acc)) + 3.0 * (np.arange(len(acc)) // n)
    recording = Recording.from_arrays(t, acc, gyr)
    of_files = replace(recording, interrupted=tuple(t[n - 1 :: n][:-1]))
    without = replace(recording, gyr=np.full_like(gyr, np.nan))
    for each, model, says in (
        (recording, "auto", "from where the gyroscope's rates lead it"),
        (of_files, "auto", "how the board was turned between its rests was not recorded"),
        (without, "auto", "holds no rates of a gyroscope"),
        (without, "static", "holds no rates of a gyroscope"),
    ):
        calibration = calibrate(each, model, G)
        assert (calibration.verdict, calibration.fit["model"]) == ("usable", "static")
        assert calibration.fit["at_prior"] == ["D_xy", "D_xz", "D_yx", "D_yz", "D_zx", "D_zy"]
        np.testing.assert_allclose(np.diag(calibration.D), np.diag(D), atol=1e-3)
        np.testing.assert_allclose(calibration.b_a, b_a, atol=0.01)
        reasons = {reason["code"]: reason["message"] for reason in calibration.quality["reasons"]}
        assert reasons.keys() == {"gyro_off", "few_orientations"}
        assert says in reasons["gyro_off"]


def test_rests_that_differ_little_are_refused(hand):
    recording = hand(1, "turns").recording.part(0, 2000)
    calibration = calibrate(replace(recording, gyr=np.zeros_like(recording.gyr)), "auto", G)
    assert calibration.verdict == "refused"


def test_a_static_calibration_is_compared_and_checked_in_the_accelerometers_own_axes(hand):
    made = hand(60, "pose12")
    with_gyroscope = calibrate(made.recording, "auto", G)
    dead = replace(made.recording, gyr=np.zeros_like(made.recording.gyr))
    alone = calibrate(dead, "auto", G)
    assert np.abs(made.truth.D - made.truth.D.T).max() > 0.02
    assert compare(alone, with_gyroscope).same
    assert "own axes" in compare(alone, with_gyroscope).remarks[-1]
    # A dead gyroscope shows neither bias nor noise, and a later one is no change of it.
    assert np.isnan(alone.b_omega).all() and np.isnan(alone.gyro_noise_std).all()
    later = hand_scenario(70, "check", rate_hz=100.0, sensor=made.truth, truth_hz=400).recording
    assert check(alone, later, days=0.0).what == "nothing"


def test_a_session_refuses_the_static_model():
    with pytest.raises(UsageError, match="does not take --model static"):
        open_source({"bus": "sim", "model": "static"})
