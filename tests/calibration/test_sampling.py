"""Claims about streams without noise: readings in coarse steps, and a turn that is too fast for the sample rate."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate
from mpucal.calibration.words import decode
from mpucal.data import Recording
from tools.lab.judge import judged
from tools.lab.scenarios.body import attitudes, specific_force

G = 9.82
D = np.array([[1.01, 0.002, -0.003], [0.001, 0.985, 0.002], [-0.002, 0.003, 1.02]])
B_A = np.array([0.31, -0.22, 0.17])
STEPS = G / 1000.0, 1e-3
STEP_S, EVERY = 1e-3, 10  # of the motion, and its steps from sample to sample
FLAT_S, LEG_S, LEGS = 10.0, 3.0, 16
SLAM_RAD_S, SLAM_S = 14.0, 0.16


def truncated(values, step):
    """Return values as a vehicle's stream has them: whole steps toward zero, centred."""
    whole = np.trunc(values / step)
    return step * (whole + 0.5 * np.sign(whole))


def on_a_turntable(seed, slam=False):
    """Return the recording of a board that a turntable turns at constant rates, about axes that it changes abruptly."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(LEGS, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    rates = np.repeat(rng.uniform(0.5, 1.5, (LEGS, 1)) * axes, int(LEG_S / STEP_S), axis=0)
    still = np.zeros((int(FLAT_S / STEP_S), 3))
    end = np.concatenate([np.tile(SLAM_RAD_S * axes[0], (int(SLAM_S / STEP_S), 1)), still])
    omega = np.concatenate([still, rates, end if slam else still[:2000]])
    acc = specific_force(attitudes(omega, STEP_S), G, np.zeros(3))[::EVERY] @ D.T + B_A
    gyr = omega[::EVERY] + rng.uniform(-0.02, 0.02, 3)
    t = STEP_S * EVERY * np.arange(len(acc))
    recording = Recording.from_arrays(t, truncated(acc, STEPS[0]), truncated(gyr, STEPS[1]))
    return replace(recording, sensor=replace(recording.sensor, steps=STEPS, message="RAW_IMU"))


def test_parameters_are_as_uncertain_as_rounding_leaves_them():
    z = np.array([judged(calibrate(on_a_turntable(seed), gravity=G), (D, B_A)).z for seed in range(6)])
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.3


def test_coarse_steps_are_found_in_readings_that_hardly_leave_them():
    """Print two decimals of a board that lies, as a sketch does: of a quiet accelerometer, and of a noisy one."""
    known = on_a_turntable(0).part(0, 1000)
    acc, gyr = np.random.default_rng(0).normal(0.0, 0.005, (2, *known.acc.shape))
    read = replace(known, sensor=replace(known.sensor, steps=(0.0, 0.0)), gyr=(known.gyr + gyr).round(2))
    for noise, step in ((acc, 0.01), (40.0 * acc, 0.0)):
        found = decode(replace(read, acc=(known.acc + noise).round(2))).recording.sensor.steps
        assert found == pytest.approx((step, 0.01))


def test_a_turn_between_few_samples_is_no_change_of_the_sensor():
    calibrations = [calibrate(on_a_turntable(seed, slam=True), gravity=G) for seed in range(4)]
    assert {calibration.verdict for calibration in calibrations} == {"good"}
    assert 0.4 < np.sqrt(np.mean(np.square([judged(calibration, (D, B_A)).z for calibration in calibrations]))) < 1.3
