"""Checks of the sample clock: one that is off, or not known, a lag between the sensors, and K's uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from mpucal.calibration import calibrate


@pytest.mark.parametrize(
    ("ppm", "std", "model", "words"),
    [
        (5000.0, 2e-5, "imu", "runs +5000 ppm"),
        (-501.0, 2e-5, "accel", "corrected"),
        (0.0, 0.01, "imu", "10000 ppm (1 sigma) only, and the gyroscope's"),
        (0.0, 0.01, "accel", "the model accel takes"),
        (499.0, 2e-5, "imu", None),
        (None, None, "imu", None),
    ],
)
def test_a_clock_that_is_off_is_reported(ideal, ppm, std, model, words):
    recording = ideal(0).recording
    spoilt = replace(recording, sensor=replace(recording.sensor, clock_ppm=ppm, clock_std=std))
    found = calibrate(spoilt, model)
    said = [reason["message"] for reason in found.quality["reasons"] if reason["code"] == "clock_off"]
    assert len(said) == (words is not None)
    assert words is None or words in said[0]
    assert found.verdict == (calibrate(recording, model).verdict if words is None else "usable")


def test_the_clocks_uncertainty_is_in_that_of_k(ideal):
    recording = ideal(0).recording
    plain = calibrate(recording, "imu")
    found = calibrate(replace(recording, sensor=replace(recording.sensor, clock_ppm=0.0, clock_std=0.01)), "imu")
    np.testing.assert_array_equal(found.K, plain.K)
    expected = np.sqrt(np.diag(plain.K_std) ** 2 + (0.01 * np.diag(plain.K)) ** 2)
    np.testing.assert_allclose(np.diag(found.K_std), expected, rtol=1e-9)


@pytest.mark.parametrize(("lag_s", "words"), [(0.03, "lags behind"), (-0.03, "runs ahead of"), (0.01, None)])
def test_a_lag_between_the_sensors_is_reported(in_hand, lag_s, words):
    recording = in_hand.recording
    acc = np.column_stack([np.interp(recording.t - lag_s, recording.t, axis) for axis in recording.acc.T])
    plain, found = calibrate(recording), calibrate(replace(recording, acc=acc))
    assert (found.verdict, len(found.quality["reasons"])) == (("good", 0) if words is None else ("usable", 1))
    for reason in found.quality["reasons"]:
        assert reason["code"] == "clock_off"
        assert f"{words} the gyroscope by " in reason["message"]
        said_ms = float(reason["message"].split("gyroscope by ")[1].split()[0])
        assert said_ms == pytest.approx(30, abs=3)
    assert np.abs(found.D - plain.D).max() < 5e-3, "the delay is estimated"
