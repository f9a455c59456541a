"""Real logs of simulated autopilots, whose sensors' truth is known."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import mpucal
from mpucal.cli import commands
from mpucal.files.tlog import tlog_of
from mpucal.result.calibration import REFUSED, Calibration

AXES = "XYZ"


@pytest.fixture(scope="module")
def replayed(tmp_path_factory):
    """replayed(path) returns the result and the folder of `mpucal session --replay`, run once a path."""
    done = {}

    def run(path):
        if path not in done:
            folder = tmp_path_factory.mktemp("replayed")
            result = CliRunner().invoke(commands, ["session", "--replay", str(path), "-o", str(folder), "--yes"])
            done[path] = (result, folder)
        return done[path]

    return run


def of_imu(folder, imu):
    document = json.loads((folder / "calibration.json").read_text())
    return document if imu == 1 else {"format": document["format"], **document["others"][imu - 2]}


@pytest.mark.parametrize(("imu", "prefix"), [(1, "INS_ACC"), (2, "INS_ACC2")])
def test_both_imus_meet_their_truth_and_keep_the_logs_parameters(captures, replayed, imu, prefix):
    result, folder = replayed(captures / "ardupilot_two_imus.tlog")
    assert result.exception is None, result.output
    truth = json.loads((captures / "ardupilot_two_imus.json").read_text())["params"]
    document = of_imu(folder, imu)
    old, new = document["autopilot"]["params_old"], document["autopilot"]["params_new"]
    for axis in AXES:
        offset, scale = f"{prefix}OFFS_{axis}", f"{prefix}SCAL_{axis}"
        assert new[offset] == pytest.approx(truth[f"SIM_ACC{imu}_BIAS_{axis}"], abs=2e-3)
        assert new[scale] == pytest.approx(truth[f"SIM_ACC{imu}_SCAL_{axis}"], abs=2e-4)
        assert (old[offset], old[scale]) == pytest.approx((truth[offset], truth[scale]))
    D = Calibration.from_document(document).D
    assert np.abs(D - np.diag(np.diag(D))).max() < 1.5e-3


def test_the_replayed_capture_holds_the_log_itself(captures, replayed):
    _, folder = replayed(captures / "ardupilot_two_imus.tlog")
    assert tlog_of(folder) == (captures / "ardupilot_two_imus.tlog").read_bytes()


def test_calibrate_and_replay_give_the_same(captures, replayed):
    _, folder = replayed(captures / "ardupilot_two_imus.tlog")
    result = CliRunner().invoke(commands, ["calibrate", str(captures / "ardupilot_two_imus.tlog"), "--json"])
    offline, live = json.loads(result.stdout), of_imu(folder, 1)
    assert offline["accelerometer"]["D"] == live["accelerometer"]["D"]
    assert len(offline["others"]) == 1


def test_a_stream_that_another_station_slowed_is_replaced_by_another(captures):
    recording = mpucal.load(captures / "mavproxy_streamrate4.tlog")
    assert recording.sensor.message == "HIGHRES_IMU"
    assert recording.rate_hz == pytest.approx(100, abs=1)


def test_px4_is_calibrated_from_a_stream_without_the_estimators_biases(captures):
    recording = mpucal.load(captures / "px4_sih_static.tlog")
    assert recording.sensor.message == "SCALED_IMU"
    assert recording.acc[:, 0].mean() == pytest.approx(-0.50, abs=0.02)


def test_a_vehicle_that_only_lay_still_is_refused_with_a_reason(captures, replayed):
    _, folder = replayed(captures / "px4_sih_static.tlog")
    quality = of_imu(folder, 1)["quality"]
    assert quality["verdict"] == REFUSED
    assert quality["reasons"][0]["code"] == "few_orientations"
