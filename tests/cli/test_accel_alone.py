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


@pytest.mark.parametrize("target", ["o.csv", "o.npz", "o.mcap"])
def test_a_calibration_is_applied_to_it(mpucal, capture, calibration, target):
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


@pytest.mark.parametrize("command", ["session", "doctor"])
def test_commands_that_need_the_gyroscope_refuse(mpucal, command):
    result = mpucal(command, *FAST)
    assert result.code == 2
    assert result.err.startswith(
        "mpucal: at 4000 Hz a chip measures with its accelerometer alone, and this needs the gyroscope:"
        " take --rate 1000 or less; `mpucal record` and `mpucal stream` accept --rate 4000.\n"
    )


def test_a_session_does_not_replay_it(mpucal, capture):
    result = mpucal("session", "--replay", capture)
    assert result.code == 2
    assert "this needs the gyroscope" in result.err


def test_a_bridge_is_too_slow_for_it(mpucal):
    result = mpucal("record", "--serial", "socket://localhost:1", "--rate", "4000")
    assert result.code == 2
    assert "a bridge cannot carry 4000 samples a second" in result.err


def test_the_filter_is_chosen(mpucal, tmp_path):
    assert mpucal("record", "--bus", "sim", "--dlpf", "6", "--seconds", "0.2", "-o", "slow.mcap").code == 0
    assert mpucal("record", "--bus", "sim", "--dlpf", "7").code == 2
    assert mpucal("record", "--bus", "sim:chip=mpu6500", "--dlpf", "0", "-o", "wide.mcap").code == 3


def test_a_chip_that_refuses_leaves_no_file_in_the_way_of_the_next_try(mpucal, tmp_path):
    slow = ("record", "--bus", "sim:chip=mpu6050,hand=still", "--seconds", "0.1", "-o", "a.mcap")
    refused = mpucal(*slow, "--rate", "4000")
    assert refused.code == 3
    assert "--rate 1000 or less" in refused.err
    assert list(tmp_path.iterdir()) == []
    assert mpucal(*slow, "--rate", "1000").code == 0
