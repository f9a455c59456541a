"""Real logs of simulated autopilots, whose sensors' truth is known.

tests/mavlink/data/px4_turned.tlog is a session with PX4 1.18-dev: SENS_BOARD_ROT 4 (yaw 180), SENS_BOARD_X_OFF 2,
SENS_BOARD_Z_OFF -1, CAL_ACC2_ROT 2 (yaw 90) of a sensor outside the board, CAL_ACC2_XOFF 0.2. A simulated hand fed its
HIL_SENSOR; of each stream every fifth sample was kept.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import mpucal
from mpucal.cli import commands
from mpucal.files.vehicle_logs import tlog_of
from mpucal.mavlink.parameters.slots import find_slot
from mpucal.result.calibration import REFUSED

RECORDED = Path(__file__).parent / "data" / "px4_turned.tlog"
# of each IMU: offset [m/s^2] and scale that are right, by what fed the sensors
TRUE = {
    1: ((-0.5851, -0.38097, -0.70241), (1.006396, 1.030025, 1.005061)),
    3: ((0.30931, 0.54022, 0.52723), (1.028497, 0.98194, 1.010728)),
}


def calibrated(path):
    """Return the documents of all IMUs by `mpucal calibrate`."""
    first = json.loads(CliRunner().invoke(commands, ["calibrate", str(path), "--json"]).stdout)
    return [first, *first["others"]]


def replayed(path, folder):
    """Return the first IMU's document by `mpucal session --replay`."""
    result = CliRunner().invoke(commands, ["session", "--replay", str(path), "-o", str(folder), "--yes"])
    assert result.exception is None or result.exit_code, result.output
    return json.loads((folder / "calibration.json").read_text())


def test_both_imus_meet_their_truth_and_keep_the_logs_parameters(captures):
    truth = json.loads((captures / "ardupilot_two_imus.json").read_text())["params"]
    for imu, document in enumerate(calibrated(captures / "ardupilot_two_imus.tlog"), 1):
        old, new = document["autopilot"]["params_old"], document["autopilot"]["params_new"]
        prefix = "INS_ACC" if imu == 1 else "INS_ACC2"
        for axis in "XYZ":
            offset, scale = f"{prefix}OFFS_{axis}", f"{prefix}SCAL_{axis}"
            assert new[offset] == pytest.approx(truth[f"SIM_ACC{imu}_BIAS_{axis}"], abs=2e-3)
            assert new[scale] == pytest.approx(truth[f"SIM_ACC{imu}_SCAL_{axis}"], abs=2e-4)
            assert (old[offset], old[scale]) == pytest.approx((truth[offset], truth[scale]))
        D = np.array(document["accelerometer"]["D"])
        assert np.abs(D - np.diag(np.diag(D))).max() < 1.5e-3


@pytest.mark.slow
def test_calibrate_and_replay_give_the_same(captures, tmp_path):
    path = captures / "ardupilot_two_imus.tlog"
    assert replayed(path, tmp_path)["accelerometer"]["D"] == calibrated(path)[0]["accelerometer"]["D"]


def test_a_stream_that_another_station_slowed_is_replaced_by_another(captures):
    recording = mpucal.load(captures / "mavproxy_streamrate4.tlog")
    assert recording.sensor.message == "HIGHRES_IMU"
    assert recording.rate_hz == pytest.approx(100, abs=1)


def test_a_px4_that_only_lay_still_is_refused_with_a_reason_and_its_capture_holds_the_log(captures, tmp_path):
    path = captures / "px4_sih_static.tlog"
    document = replayed(path, tmp_path)
    assert document["quality"]["verdict"] == REFUSED
    assert document["quality"]["reasons"][0]["code"] == "few_orientations"
    assert tlog_of(tmp_path) == path.read_bytes()
    # not HIGHRES_IMU, which lacks the estimator's biases
    recording = mpucal.load(tmp_path / "capture.mcap")
    assert recording.sensor.message == "SCALED_IMU"
    assert recording.acc[:, 0].mean() == pytest.approx(-0.50, abs=0.02)


def test_parameters_are_right_in_each_sensors_own_axes():
    documents = {one["autopilot"]["imu"]: one["autopilot"] for one in calibrated(RECORDED)}
    for imu, (offset, scale) in TRUE.items():
        found = find_slot("PX4", imu, documents[imu]["params_old"]).correction(documents[imu]["params_new"])
        assert found.offset == pytest.approx(np.array(offset), abs=4e-3)
        assert found.scale == pytest.approx(np.array(scale), abs=2e-3)
    # yaw 180 and back, yaw 90
    inside, outside = (np.array(documents[imu]["mounting"]) for imu in (1, 3))
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert inside.T @ outside == pytest.approx(turn, abs=1e-9)
