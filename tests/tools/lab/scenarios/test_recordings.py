from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mpucal.calibration.rotation import rotation
from mpucal.errors import UsageError
from tools.lab.judge import sph_rms
from tools.lab.scenarios.recordings import GRAVITY_MPS2, MOTIONS, hand_scenario, paper_scenario
from tools.lab.scenarios.sensors import hand_sensor, paper_sensor

SHARED = Path(__file__).parents[4].parent / "shared" / "simulated"
# each is simulated once, and changed by no test
by_hand, as_in_the_paper = cache(hand_scenario), cache(paper_scenario)


def residual(simulated):
    """Return what the accelerometer read beyond D R(x) g + b_a: noise and the hand's acceleration."""
    truth = simulated.truth
    return simulated.recording.acc - simulated.specific_force @ truth.D.T - truth.b_a


def rates(simulated):
    truth = simulated.truth
    return (simulated.recording.gyr - truth.b_omega) @ truth.K.T


@pytest.fixture(scope="module", params=["paper", *MOTIONS])
def simulated(request):
    return as_in_the_paper(3) if request.param == "paper" else by_hand(3, request.param)


def test_gravity_keeps_its_magnitude_and_follows_the_attitude(simulated):
    s = simulated.specific_force
    # the mean over a sample is short of g by the square of the angle turned in it
    np.testing.assert_allclose(np.linalg.norm(s, axis=1), GRAVITY_MPS2, rtol=1e-4)
    np.testing.assert_allclose(GRAVITY_MPS2 * simulated.attitude[:, :, 2], s, atol=1e-3)


def test_the_gyroscope_integrates_to_the_attitude(simulated):
    recording, omega = simulated.recording, rates(simulated)
    delta = np.diff(recording.t)[:, None]
    between = omega[:-1] if "paper" in recording.name else 0.5 * (omega[1:] + omega[:-1])
    steps = rotation(-delta * between)
    off = steps @ simulated.attitude[:-1] @ np.swapaxes(simulated.attitude[1:], -1, -2)
    angle = np.stack([off[:, 2, 1] - off[:, 1, 2], off[:, 0, 2] - off[:, 2, 0], off[:, 1, 0] - off[:, 0, 1]], 1) / 2
    noise = omega[recording.flat[0] : recording.flat[1]].std(0) * delta[0]
    assert (angle.std(0) < 1.2 * noise).all()
    # without drift: the sum of the steps' errors is a random walk
    assert (np.abs(angle.sum(0)) < 5 * noise * np.sqrt(len(angle))).all()


def test_it_lies_flat_and_still_first(simulated):
    first, last = simulated.recording.flat
    assert np.ptp(simulated.specific_force[first:last], axis=0).max() < 1e-9
    assert np.abs(residual(simulated)[first:last].mean(0)).max() < 0.02
    assert last * np.median(np.diff(simulated.recording.t)) == pytest.approx(10.0)


@pytest.mark.parametrize("make", [paper_scenario, lambda seed: hand_scenario(seed, "turns")], ids=["paper", "hand"])
def test_a_seed_is_a_recording(make):
    first = make(5).recording.acc
    np.testing.assert_array_equal(first, make(5).recording.acc)
    assert not np.array_equal(first, make(6).recording.acc)


def test_a_seed_is_the_same_sensor_and_motion_whatever_else_is_asked():
    plain, trembling, turned = (
        by_hand(3, "pose7"),
        by_hand(3, "pose7", tremble=True),
        by_hand(3, "turns"),
    )
    np.testing.assert_array_equal(plain.truth.D, turned.truth.D)
    np.testing.assert_array_equal(plain.truth.D, trembling.truth.D)
    np.testing.assert_allclose(plain.specific_force, trembling.specific_force, atol=1.0)


def test_one_complete_turn_about_each_axis():
    s = as_in_the_paper(0).specific_force
    for k in (1000, 2000, 3000):
        np.testing.assert_allclose(s[k], [0, 0, GRAVITY_MPS2], atol=1e-9)
    np.testing.assert_allclose(s[1500], [0, 0, -GRAVITY_MPS2], atol=1e-9)
    np.testing.assert_allclose(s[2500], [0, 0, -GRAVITY_MPS2], atol=1e-9)


def test_slow_turns_take_longer():
    simulated = as_in_the_paper(0, rate_hz=50, turn_s=40)
    assert len(simulated.recording) == 500 + 3 * 2000


def test_many_noises_of_one_sensor():
    sensor = paper_sensor(np.random.default_rng(0))
    one, other = paper_scenario(1, sensor=sensor), paper_scenario(2, sensor=sensor)
    np.testing.assert_array_equal(one.truth.D, other.truth.D)
    assert not np.array_equal(one.recording.acc, other.recording.acc)


def test_a_trembling_hand_trembles_in_its_poses_only():
    simulated, calm = by_hand(3, "pose6", tremble=True), by_hand(3, "pose6")
    hold = slice(2600, 3500)
    tremor = residual(simulated)[hold] - residual(calm)[hold]
    assert (np.sqrt((tremor**2).mean(0)) > 0.07).all()
    assert (np.sqrt((tremor**2).mean(0)) < 0.14).all()
    assert (np.degrees(rates(simulated)[hold].std(0)) > 0.7).all()
    assert (np.degrees(rates(simulated)[hold].std(0)) < 1.4).all()
    np.testing.assert_array_equal(simulated.recording.acc[:2000], calm.recording.acc[:2000])


@pytest.mark.parametrize("delay_s", [0.001, 0.01])
def test_a_delay_is_the_accelerometers(delay_s):
    plain, late = by_hand(3, "continuous"), by_hand(3, "continuous", delay_s=delay_s)
    np.testing.assert_array_equal(late.recording.gyr, plain.recording.gyr)
    np.testing.assert_array_equal(late.specific_force, plain.specific_force)
    # what the accelerometer lags is its derivative times the delay
    t = plain.recording.t
    derivative = np.gradient(plain.specific_force @ plain.truth.D.T, t, axis=0)
    lag = late.recording.acc - plain.recording.acc
    slope = (lag * derivative).sum() / (derivative**2).sum()
    assert slope == pytest.approx(-delay_s, rel=0.1)


def test_counts_are_whole():
    simulated = by_hand(3, "pose12")
    counts = simulated.recording.acc / (2 * 9.80665 / 32768)
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)


def test_calm_is_calm_but_for_its_jerks():
    simulated = by_hand(3, "calm jerks")
    np.testing.assert_allclose(simulated.truth.K, np.eye(3), atol=1e-12)
    quiet = np.linalg.norm(residual(simulated)[2000:], axis=1) < 0.2
    # three jerks of 90 ms a second
    assert 0.6 < quiet.mean() < 0.9


def test_an_unknown_motion_is_said_to_be_one():
    with pytest.raises(UsageError, match="pose12"):
        by_hand(0, "juggling")


def test_uncalibrated_sensors_are_as_far_off_as_is_known():
    def mean(sensors):
        errors = []
        for sensor in sensors:
            D, b = sensor.symmetric()[0].D - np.eye(3), sensor.b_a
            errors.append(np.sqrt(GRAVITY_MPS2**2 / 3 * (D**2).sum() + b @ b))
        return np.mean(errors)

    rngs = [np.random.default_rng(seed) for seed in range(400)]
    assert mean([hand_sensor(rng) for rng in rngs]) == pytest.approx(0.852, rel=0.06)
    assert mean([paper_sensor(rng) for rng in rngs]) == pytest.approx(4.32, rel=0.06)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the other simulator's recordings are not beside this checkout")
@pytest.mark.parametrize(
    ("file", "motion"), [("pose12_0", "pose12"), ("pose6_0", "pose6"), ("rot_0", "continuous")], ids=lambda x: x
)
def test_it_agrees_with_another_simulator_in_what_can_be_counted(file, motion):
    with np.load(SHARED / f"{file}.npz") as other:
        omega = (other["gyr"] - other["true_b_omega"]) @ other["true_K"].T
        beyond = other["acc"] - other["true_specific_force"] @ other["true_D"].T - other["true_b_a"]
        gravity = float(other["gravity"])
        t = other["t"]
    ours = [by_hand(seed, motion) for seed in (2, 3)]
    assert gravity == GRAVITY_MPS2
    np.testing.assert_allclose(ours[0].recording.t, t, atol=1e-9)
    rms = np.sqrt(np.mean([np.square(rates(one)[2000:]).mean() for one in ours]))
    assert rms == pytest.approx(np.sqrt((omega[2000:] ** 2).mean()), rel=0.25)
    noise = np.mean([residual(one)[:2000].std() for one in ours])
    assert noise == pytest.approx(beyond[:2000].std(), rel=0.03)
    gyro_noise = np.mean([rates(one)[:2000].std(0) for one in ours])
    assert gyro_noise == pytest.approx(omega[:2000].std(0).mean(), rel=0.03)
    hand = np.mean([residual(one)[2000:].std() for one in ours])
    assert hand == pytest.approx(beyond[2000:].std(), rel=0.4)


def test_sph_rms_of_no_calibration_is_what_a_sensor_is_off():
    simulated = as_in_the_paper(11)
    uncalibrated = sph_rms(simulated.truth, np.eye(3), np.zeros(3))
    off = simulated.specific_force @ simulated.truth.D.T + simulated.truth.b_a - simulated.specific_force
    assert uncalibrated == pytest.approx(np.sqrt((off**2).sum(1).mean()), rel=0.5)
