"""Rests in ordinary use: a calibration that is right is left alone, a wrong one is told once."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

import mpucal
from mpucal.data import Sensor
from mpucal.recheck import drift
from mpucal.recheck.watch import LEAST_RESTS, RESTS, Watch
from tools.lab.scenarios.recordings import GRAVITY_MPS2, hand_scenario
from tools.lab.scenarios.sensors import hand_sensor

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


def told(truth, seed=1, spoil=lambda recording: recording):
    """What is said of seven poses in a trembling hand, in parts of a quarter of a second."""
    recording = spoil(hand_scenario(seed, "pose7", tremble=True, rate_hz=100.0, sensor=truth, truth_hz=400).recording)
    recording = replace(recording, temperature_c=np.full(len(recording), 25.0))
    acc, gyr = CALIBRATION.apply(recording.acc, recording.gyr)
    watch, said = Watch(CALIBRATION, 1.0), []
    calibrated = replace(recording, acc=acc, gyr=gyr)
    for first in range(0, len(recording), 25):
        said += watch.add(calibrated.part(first, first + 25))
    return said, watch


@pytest.mark.parametrize("seed", range(4))
def test_a_right_calibration_is_left_alone(seed):
    said, watch = told(TRUTH, seed)
    assert not said
    assert len(watch._rests) > LEAST_RESTS


def test_a_bias_that_moved_is_told_once():
    said, _ = told(replace(TRUTH, b_a=TRUTH.b_a + np.array([0.0, 12.0, 0.0]) * drift.MG))
    assert len(said) == 1
    assert abs(float(said[0].what.split("up to ")[1].split(" mg")[0])) == pytest.approx(12.0, abs=4.0)


def test_a_gyroscope_that_moved_is_told():
    said, _ = told(replace(TRUTH, b_omega=TRUTH.b_omega + np.radians([0.0, 3.0, 0.0])))
    assert "turns by up to 3" in said[0].what


def test_a_rest_that_was_none_decides_nothing():
    """A vehicle that brakes evenly for some seconds."""

    def braked(recording):
        acc = recording.acc.copy()
        acc[(recording.t > 15.0) & (recording.t < 18.0), 0] += 0.8
        return replace(recording, acc=acc)

    assert not told(TRUTH, spoil=braked)[0]


def test_memory_does_not_grow_while_it_lies():
    recording = hand_scenario(0, "pose12", rate_hz=100.0, sensor=TRUTH, truth_hz=400).recording.part(0, 900)
    acc, gyr = CALIBRATION.apply(recording.acc, recording.gyr)
    lying = replace(recording, acc=acc, gyr=gyr)
    watch, weights = Watch(CALIBRATION, 1.0), []
    tracemalloc.start()
    try:
        for k in range(30):
            assert not watch.add(replace(lying, t=lying.t + 9.0 * k))
            weights.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert len(watch._rests) == RESTS
    assert max(weights[20:]) < max(weights[:20]) + 300_000
