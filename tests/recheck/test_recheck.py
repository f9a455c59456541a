"""The check and the monitor against simulated truth, and their parts against finite differences and chance."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import mpucal
from mpucal.calibration.rotation import rotation
from mpucal.data import Sensor
from mpucal.errors import RefusedError
from mpucal.recheck import drift
from mpucal.recheck.hypotheses import NOTHING, compare_hypotheses
from mpucal.recheck.observed import CALIBRATED, LEAST_ORIENTATIONS, PARAMETERS, apply_errors, observe
from mpucal.recheck.outcome import Change
from mpucal.recheck.update import update_biases
from mpucal.recheck.watch import RESTS, DriftMonitor
from mpucal.result.correlation import NAMES
from mpucal.result.error_model import MG_PER_MPS2
from tools.lab.scenarios.recordings import hand_scenario
from tools.lab.scenarios.sensors import GRAVITY_MPS2, hand_sensor

TRUTH = hand_sensor(np.random.default_rng(3)).symmetric()[0]
CALIBRATION = mpucal.Calibration(
    D=TRUTH.D,
    b_a=TRUTH.b_a,
    D_std=np.full((3, 3), 2e-4),
    b_a_std=np.full(3, 2e-3),
    K=TRUTH.K,
    K_std=np.full((3, 3), 5e-4),
    b_omega=TRUTH.b_omega,
    b_omega_std=np.full(3, 1e-4),
    fit={"gravity": GRAVITY_MPS2, "model": "hand"},
    quality={"verdict": "good"},
    sensor=Sensor(chip="MPU-6050", temperature_c=25.0),
)
TEN_MG = np.array([0.0, 10.0, 0.0]) / MG_PER_MPS2


def shown(truth, seed=7, temperature_c=25.0):
    recording = hand_scenario(seed, "check", tremble=True, sensor=truth, truth_hz=400).recording
    return replace(recording, flat=None, temperature_c=np.full(len(recording), temperature_c))


def noisier(factor, sensor="acc", seed=7):
    """Return a recording of the unchanged sensor with so many times its noise."""
    recording = shown(TRUTH, seed)
    std = getattr(recording, sensor)[:500].std(0)
    extra = np.random.default_rng(seed).normal(0.0, np.sqrt(factor**2 - 1.0) * std, (len(recording), 3))
    return replace(recording, **{sensor: getattr(recording, sensor) + extra})


HAPPENED = {
    "nothing": (TRUTH, "still good", "nothing"),
    "bias": (TRUTH._replace(b_a=TRUTH.b_a + TEN_MG), "drifted", "bias"),
    "scale": (TRUTH._replace(D=TRUTH.D @ np.diag([1.0, 1.0, 1.02])), "drifted", "scale"),
    "mount": (TRUTH._replace(D=TRUTH.D @ rotation(np.radians([0.8, 0.6, 0.0]))), "remounted", "mount"),
    "gyroscope": (TRUTH._replace(b_omega=TRUTH.b_omega + np.radians([0, 6, 0])), "drifted", "gyroscope's bias"),
    "another": (hand_sensor(np.random.default_rng(9)), "another sensor", "another sensor"),
}


@pytest.mark.parametrize("name", HAPPENED)
def test_a_check_names_the_change(name):
    truth, verdict, what = HAPPENED[name]
    result = mpucal.check(CALIBRATION, shown(truth), days=1.0)
    assert (result.verdict, result.what) == (verdict, what)
    assert verdict in result.page().lower()
    if name == "mount":
        with pytest.raises(RefusedError):
            update_biases(CALIBRATION, result, shown(truth), "")


def test_a_check_of_a_vehicle_speaks_of_the_vehicle():
    sensor = Sensor(chip="ArduPilot-IMU1", message="RAW_IMU")
    moving = replace(shown(TRUTH), acc=np.random.default_rng(1).normal(0.0, 9.0, (len(shown(TRUTH)), 3)), sensor=sensor)
    result = mpucal.check(replace(CALIBRATION, sensor=sensor), moving, days=1.0)
    assert (result.message, result.remedy[:20]) == ("the vehicle never rested", "lay the vehicle flat")


@pytest.mark.parametrize(("sensor", "words"), [("acc", "3 times on the accel"), ("gyr", "3.1 times on the gyro")])
def test_noise_that_grew_is_named(sensor, words):
    quiet = shown(TRUTH, seed=6)
    known = replace(
        CALIBRATION,
        noise_std=quiet.acc[:500].std(0),
        gyro_noise_std=quiet.gyr[:500].std(0),
        sensor=replace(CALIBRATION.sensor, rate_hz=quiet.sensor.rate_hz),
    )
    assert mpucal.check(known, noisier(1.2, sensor), days=1.0).what == "nothing"
    checked = mpucal.check(known, noisier(3.0, sensor), days=1.0)
    assert (checked.verdict, checked.what, checked.only_biases) == ("drifted", "noise", False)
    assert words in checked.message


def test_a_hand_that_trembles_on_the_first_rest_is_no_noise():
    recording = shown(TRUTH)
    sensor = replace(CALIBRATION.sensor, rate_hz=recording.sensor.rate_hz)
    known = replace(CALIBRATION, noise_std=np.full(3, 0.02), gyro_noise_std=np.full(3, 1e-3), sensor=sensor)
    tremble = 0.1 * np.sin(2.0 * np.pi * 4.0 * recording.t)[:, None]
    assert mpucal.check(known, replace(recording, acc=recording.acc + tremble), days=1.0).what != "noise"


def test_values_are_printed_to_the_second_digit_of_their_uncertainties():
    change = Change("deg", (5.6e-5, -1.234, 56.0), (0.02, 0.02, 0.3))
    assert change.text() == "x +0.000 ± 0.020, y -1.234 ± 0.020, z +56.00 ± 0.30"


def test_a_new_bias_is_estimated_and_its_history_kept():
    truth = HAPPENED["bias"][0]
    recording = shown(truth)
    checked = mpucal.check(CALIBRATION, recording, days=1.0)
    bias = checked.changes["bias"]
    assert np.all(np.abs(np.array(bias.value) - [0, 10, 0]) < 4 * np.array(bias.std))
    after = update_biases(CALIBRATION, checked, recording, "2026-01-02T00:00:00+00:00")
    np.testing.assert_array_equal(after.D, CALIBRATION.D)
    np.testing.assert_allclose(after.b_a, truth.b_a, atol=4 * after.b_a_std.max())
    assert mpucal.check(after, shown(truth, seed=8), days=0.0).verdict == "still good"
    again = update_biases(after, mpucal.check(after, recording), recording, "2026-01-03T00:00:00+00:00")
    history = mpucal.Calibration.from_document(again.document()).extra["updated_from"]
    assert [entry["found"] for entry in history] == ["drifted", "still good"]
    np.testing.assert_array_equal(history[0]["b_a"], CALIBRATION.b_a)


def test_a_change_of_temperature_explains_what_the_data_sheet_allows_and_no_more():
    warm = TRUTH._replace(b_a=TRUTH.b_a + 0.8 * TEN_MG)
    explained = mpucal.check(CALIBRATION, shown(warm, temperature_c=45.0), days=1.0)
    assert explained.verdict == "drifted"
    assert explained.temperature_explains
    hot = TRUTH._replace(b_a=TRUTH.b_a + 8.0 * TEN_MG)
    assert mpucal.check(CALIBRATION, shown(hot, temperature_c=30.0), days=1.0).temperature_explains is False


def test_a_known_b_a_of_t_is_not_called_a_drift():
    slope = 0.05 * TEN_MG
    known = replace(CALIBRATION, b_a_slope=slope, b_a_slope_std=np.zeros(3), temperature_range_c=np.array([0.0, 60.0]))
    warm = TRUTH._replace(b_a=TRUTH.b_a + 20.0 * slope)
    assert mpucal.check(known, shown(warm, temperature_c=45.0), days=1.0).verdict == "still good"


def test_too_few_orientations_allow_no_verdict():
    recording = shown(TRUTH)
    still = recording.part(0, round(9.0 * recording.rate_hz))
    checked = mpucal.check(CALIBRATION, still, days=1.0)
    assert (checked.verdict, checked.exit_code) == ("cannot be told", 4)
    assert "1 of the 4 orientations" in checked.message
    moving = recording.part(len(recording) - 50, len(recording))
    assert mpucal.check(CALIBRATION, moving).verdict == "cannot be told"


def test_a_flat_segment_too_short_to_estimate_noise_is_ignored():
    recording = shown(TRUTH)
    assert observe(replace(recording, flat=(0, 2)), CALIBRATION) is None
    assert observe(replace(recording, flat=(0, 400)), CALIBRATION) is not None


def test_another_chip_is_recognised_by_who_am_i_and_factory_trim():
    known = replace(CALIBRATION, sensor=replace(CALIBRATION.sensor, who_am_i=0x68, accel_offsets=(2, 4, 6)))
    recording = shown(TRUTH)
    for sensor in (Sensor(who_am_i=0x70), Sensor(who_am_i=0x68, accel_offsets=(2, 4, 9000))):
        assert mpucal.check(known, replace(recording, sensor=sensor)).verdict == "another sensor"


def test_the_prior_is_the_covariance_of_the_fit():
    recording = replace(hand_scenario(4, "pose9", rate_hz=50.0, truth_hz=400).recording, flat=None)
    fit = mpucal.calibration.estimate(recording, "hand", GRAVITY_MPS2)[0].fit
    calibration = mpucal.calibrate(recording, "hand", GRAVITY_MPS2)
    stored = mpucal.Calibration.from_document(calibration.document())
    names = [fit.names.index(name) for name in NAMES]
    covariance, to_errors = fit.covariance[np.ix_(names, names)], np.linalg.inv(drift.to_theta(stored))
    prior = (to_errors @ drift.own_uncertainty(stored) @ to_errors.T)[:CALIBRATED, :CALIBRATED]
    std = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(prior / np.outer(std, std), covariance / np.outer(std, std), atol=1e-4)
    assert np.abs(stored.correlation - np.eye(21)).max() > 0.1


def test_the_observations_are_linear_in_theta():
    rng = np.random.default_rng(0)
    recording = shown(TRUTH)
    before = observe(recording, CALIBRATION)
    for i in range(0, CALIBRATED, 2):
        theta = np.zeros(PARAMETERS)
        theta[i] = 1e-4 * rng.choice([-1.0, 1.0])
        # A calibration that is wrong by theta sees a right sensor as wrong by -theta.
        after = observe(recording, apply_errors(CALIBRATION, -theta))
        np.testing.assert_allclose(after.r - before.r, before.J @ theta, atol=2e-6, err_msg=str(i))


def test_an_unchanged_sensor_is_called_changed_as_often_as_designed():
    recording = shown(TRUTH)
    observed = observe(recording, CALIBRATION)
    nothing = drift.own_uncertainty(CALIBRATION) + drift.ageing(CALIBRATION, 1.0, 0.0)
    hypotheses = drift.hypotheses(CALIBRATION, 0.0)
    S = observed.J @ nothing @ observed.J.T + observed.R
    n = 20
    draws = np.random.default_rng(5).multivariate_normal(np.zeros(len(S)), S, n)
    found = [compare_hypotheses(replace(observed, r=r), nothing, hypotheses) for r in draws]
    assert sum(w.likeliest != NOTHING for w in found) <= 2
    p = np.sort([w.probability for w in found])
    # Kolmogorov and Smirnov's statistic, 1.63 at 1 %
    assert np.sqrt(n) * np.abs(p - (np.arange(n) + 0.5) / n).max() < 1.63


def monitored(truth, seed=1, spoil=lambda recording: recording):
    """Return the contradictions in seven poses in a trembling hand, and the monitor; parts are 0.25 s long."""
    recording = spoil(hand_scenario(seed, "pose7", tremble=True, rate_hz=100.0, sensor=truth, truth_hz=400).recording)
    recording = replace(recording, temperature_c=np.full(len(recording), 25.0))
    acc, gyr = CALIBRATION.apply(recording.acc, recording.gyr)
    monitor, said = DriftMonitor(CALIBRATION, 1.0), []
    calibrated = replace(recording, acc=acc, gyr=gyr)
    for first in range(0, len(recording), 25):
        said += monitor.add(calibrated.part(first, first + 25))
    return said, monitor


def test_a_monitor_is_silent_about_a_right_calibration():
    said, monitor = monitored(TRUTH)
    assert not said
    assert len(monitor._rests) > LEAST_ORIENTATIONS


def test_a_monitor_reports_once_a_bias_that_moved():
    said, _ = monitored(TRUTH._replace(b_a=TRUTH.b_a + np.array([0.0, 12.0, 0.0]) / MG_PER_MPS2))
    assert len(said) == 1
    assert abs(float(said[0].what.split("up to ")[1].split(" mg")[0])) == pytest.approx(12.0, abs=4.0)
    said, _ = monitored(TRUTH._replace(b_omega=TRUTH.b_omega + np.radians([0.0, 3.0, 0.0])))
    assert "the rate is up to 3" in said[0].what


def test_a_vehicle_that_brakes_evenly_decides_nothing():
    def braked(recording):
        acc = recording.acc.copy()
        acc[(recording.t > 15.0) & (recording.t < 18.0), 0] += 0.8
        return replace(recording, acc=acc)

    assert not monitored(TRUTH, spoil=braked)[0]


def test_memory_of_a_monitor_does_not_grow_while_the_board_lies():
    recording = hand_scenario(0, "pose12", rate_hz=100.0, sensor=TRUTH, truth_hz=400).recording.part(0, 900)
    acc, gyr = CALIBRATION.apply(recording.acc, recording.gyr)
    lying = replace(recording, acc=acc, gyr=gyr)
    monitor, sizes = DriftMonitor(CALIBRATION, 1.0), []
    for k in range(22):
        assert not monitor.add(replace(lying, t=lying.t + 9.0 * k))
        sizes.append(len(pickle.dumps(monitor)))
    assert len(monitor._rests) == RESTS
    assert max(sizes[18:]) < 1.2 * sizes[17]
