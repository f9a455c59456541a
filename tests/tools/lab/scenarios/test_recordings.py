"""The simulated hands and the paper's simulation: their physics, and what can be counted beside another simulator."""

from functools import cache

import numpy as np
import pytest

from mpucal.calibration.rotation import rotation
from tools.lab.judge import sph_rms
from tools.lab.scenarios.body import attitudes, board_from_world, lever_acceleration
from tools.lab.scenarios.recordings import hand_scenario, paper_scenario
from tools.lab.scenarios.sensors import GRAVITY_MPS2, hand_sensor, paper_sensor

# each is simulated once, and changed by no test
by_hand, as_in_the_paper = cache(hand_scenario), cache(paper_scenario)


def residual(simulated):
    """Return what the accelerometer read beyond D R(x) g + b_a: noise and the hand's acceleration."""
    truth = simulated.truth
    return simulated.recording.acc - simulated.specific_force @ truth.D.T - truth.b_a


def rates(simulated):
    truth = simulated.truth
    return (simulated.recording.gyr - truth.b_omega) @ truth.K.T


@pytest.mark.parametrize("motion", ["paper", "pose6", "continuous", "calm jerks"])
def test_gravity_and_gyroscope_follow_the_attitude_from_a_flat_rest(motion):
    simulated = as_in_the_paper(3) if motion == "paper" else by_hand(3, motion)
    recording, s, omega = simulated.recording, simulated.specific_force, rates(simulated)
    first, last = recording.flat
    # the mean over a sample is short of g by the square of the angle turned in it
    np.testing.assert_allclose(np.linalg.norm(s, axis=1), GRAVITY_MPS2, rtol=1e-4)
    np.testing.assert_allclose(GRAVITY_MPS2 * simulated.attitude[:, :, 2], s, atol=1e-3)
    assert np.ptp(s[first:last], axis=0).max() < 1e-9
    assert np.abs(residual(simulated)[first:last].mean(0)).max() < 0.02
    delta = np.diff(recording.t)[:, None]
    between = omega[:-1] if motion == "paper" else 0.5 * (omega[1:] + omega[:-1])
    off = rotation(-delta * between) @ simulated.attitude[:-1] @ np.swapaxes(simulated.attitude[1:], -1, -2)
    angle = np.stack([off[:, 2, 1] - off[:, 1, 2], off[:, 0, 2] - off[:, 2, 0], off[:, 1, 0] - off[:, 0, 1]], 1) / 2
    noise = omega[first:last].std(0) * delta[0]
    assert (angle.std(0) < 1.2 * noise).all()
    # without drift: the sum of the steps' errors is a random walk
    assert (np.abs(angle.sum(0)) < 5 * noise * np.sqrt(len(angle))).all()


def test_a_seed_gives_the_same_sensor_and_motion_beside_other_options():
    plain, trembling = by_hand(3, "pose6"), by_hand(3, "pose6", tremble=True)
    np.testing.assert_array_equal(plain.truth.D, by_hand(3, "continuous").truth.D)
    np.testing.assert_array_equal(plain.truth.D, trembling.truth.D)
    np.testing.assert_array_equal(trembling.recording.acc[:2000], plain.recording.acc[:2000])
    tremor = (residual(trembling) - residual(plain))[2600:3500]
    np.testing.assert_allclose(np.sqrt((tremor**2).mean(0)), 0.1, rtol=0.4)
    np.testing.assert_allclose(np.degrees(rates(trembling)[2600:3500].std(0)), 1.0, rtol=0.4)


def test_a_delay_is_the_accelerometers():
    plain, late = by_hand(3, "continuous"), by_hand(3, "continuous", delay_s=0.01)
    np.testing.assert_array_equal(late.recording.gyr, plain.recording.gyr)
    # the lag of the accelerometer is its derivative times the delay
    derivative = np.gradient(plain.specific_force @ plain.truth.D.T, plain.recording.t, axis=0)
    lag = late.recording.acc - plain.recording.acc
    assert (lag * derivative).sum() / (derivative**2).sum() == pytest.approx(-0.01, rel=0.1)


def test_a_levers_acceleration_is_the_second_derivative_of_its_path():
    step_s = 1 / 1000
    t = step_s * np.arange(20000)[:, None]
    omega = np.concatenate([1.2 * np.sin(1.7 * t), 0.8 * np.cos(0.9 * t), 1.5 * np.sin(0.4 * t + 1)], axis=1)
    r = np.array([0.1, -0.2, 0.15]) + 0.05 * np.concatenate([np.sin(2 * t), np.cos(t), np.sin(3 * t)], axis=1)
    R = board_from_world(attitudes(0.5 * (omega[1:] + omega[:-1]), step_s))
    path = (np.swapaxes(R, -1, -2) @ r[..., None])[..., 0]
    from_path = (path[2:] - 2 * path[1:-1] + path[:-2]) / step_s**2
    in_body = (R[1:-1] @ from_path[..., None])[..., 0]
    np.testing.assert_allclose(lever_acceleration(omega, r, step_s)[2:-2], in_body[1:-1], atol=1e-5)


@pytest.mark.parametrize(("draw", "error_mps2"), [(hand_sensor, 0.852), (paper_sensor, 4.32)], ids=["hand", "paper"])
def test_uncalibrated_sensors_are_as_far_off_as_is_known(draw, error_mps2):
    sensors = [draw(np.random.default_rng(seed)).symmetric()[0] for seed in range(400)]
    errors = [sph_rms(sensor, np.eye(3), np.zeros(3)) for sensor in sensors]
    assert np.mean(errors) == pytest.approx(error_mps2, rel=0.06)


@pytest.mark.parametrize(("file", "motion"), [("pose6_0", "pose6"), ("rot_0", "continuous")])
def test_noise_and_rates_agree_with_another_simulator(file, motion, shared):
    with np.load(*shared(f"simulated/{file}.npz")) as other:
        omega = (other["gyr"] - other["true_b_omega"]) @ other["true_K"].T
        beyond = other["acc"] - other["true_specific_force"] @ other["true_D"].T - other["true_b_a"]
        assert float(other["gravity"]) == GRAVITY_MPS2
        t = other["t"]
    ours = [by_hand(seed, motion) for seed in (2, 3)]
    np.testing.assert_allclose(ours[0].recording.t, t, atol=1e-9)
    for figure, theirs, rel in (
        (lambda one: rates(one)[2000:].std(), omega[2000:].std(), 0.25),
        (lambda one: residual(one)[:2000].std(), beyond[:2000].std(), 0.03),
        (lambda one: rates(one)[:2000].std(0), omega[:2000].std(0).mean(), 0.03),
        (lambda one: residual(one)[2000:].std(), beyond[2000:].std(), 0.4),
    ):
        assert np.mean([figure(one) for one in ours]) == pytest.approx(theirs, rel=rel)
