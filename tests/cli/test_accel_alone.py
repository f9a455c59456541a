"""The accelerometer alone at 4 kHz: recorded, replayed, calibrated with; and what needs the gyroscope says so."""

import json

import numpy as np
import pytest

from mpucal.result.calibration import Calibration

FAST = ("--bus", "sim:chip=mpu6500,hand=still,D=1.02/0/0/0/0.98/0/0/0/1.01,b_a=0.3/-0.2/0.4", "--rate", "4000")


@pytest.fixture
def capture(mpucal, tmp_path):
    result = mpucal("record", *FAST, "--seconds", "0.5", "-o", "fast.mcap")
    assert (result.code, result.err) == (0, "")
    return tmp_path / "fast.mcap"


@pytest.fixture
def calibration(tmp_path):
    made = Calibration(
        np.diag([1.02, 0.98, 1.01]), np.array([0.3, -0.2, 0.4]), quality={"verdict": "good", "reasons": []}
    )
    made.save(tmp_path / "c.json")


def test_a_recording_of_the_accelerometer_alone_is_shown(mpucal, capture):
    shown = json.loads(mpucal("show", capture, "--json").out)
    assert shown["samples"] == pytest.approx(2000, abs=40)
    assert shown["rate_hz"] == pytest.approx(4000, rel=0.01)
    assert shown["gyro_range_dps"] is shown["fastest_dps"] is None
    assert shown["temperature_c"][0] == pytest.approx(25, abs=15)
    assert "fastest turn  not measured" in mpucal("show", capture).out


def test_a_calibration_is_applied_to_it(mpucal, capture, calibration):
    for target in ("o.csv", "o.mcap"):
        result = mpucal("apply", "c.json", capture, "-o", target, "--json")
        assert result.code == 0, result.err
        assert json.loads(result.out)["mean_after_mps2"] == pytest.approx(9.80665, abs=0.01)


def test_the_accelerometer_alone_is_streamed_without_rates(mpucal, calibration):
    words = ("stream", *FAST, "--apply", "c.json", "--seconds", "0.05")
    lines = mpucal(*words).out.splitlines()
    assert lines[0] == "t,ax,ay,az,utc_s"
    assert len(lines) > 150
    sample = json.loads(mpucal(*words, "--json").out.splitlines()[0])
    assert sample["w"] is sample["temperature_c"] is None


def test_the_accelerometer_alone_cannot_be_calibrated(mpucal, capture):
    result = mpucal("calibrate", capture, "--json")
    assert result.code == 5
    reason, of_rests = json.loads(result.out)["quality"]["reasons"]
    assert reason["code"] == "gyro_off"
    assert "record the gyroscope as well, at 1000 Hz or less" in reason["message"]
    assert of_rests["code"] == "never_still", "what the rests alone lack"


def test_what_needs_the_gyroscope_refuses_it(mpucal, capture):
    for words in (("session", *FAST), ("doctor", *FAST), ("session", "--replay", capture)):
        result = mpucal(*words)
        assert result.code == 2
        assert "at 4000 Hz a chip measures with its accelerometer alone, and this needs the gyroscope" in result.err
