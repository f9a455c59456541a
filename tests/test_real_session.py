"""The main task on a real MPU-6050's measurements: counts to registers, to a session, to D and b_a."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mpucal.__main__ import run
from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.cli.running import open_runner
from mpucal.files import load
from mpucal.result.calibration import Calibration
from mpucal.session.plan import Plan
from mpucal.sources.chip import OpenedChip
from mpucal.terminal.console import console
from tools.lab.feeds import open_recorded

PROJECT = Path(__file__).parents[1]
SHARED = PROJECT.parent / "shared"
RECORDINGS = SHARED / "recordings"
RECORDING = RECORDINGS / "mpu6050_session.npz"
# a session polls five times as often, to guide the person
LONG_POLL_S = 0.2
YARDSTICK = SHARED / "check" / "gravity_transport.py"

pytestmark = pytest.mark.skipif(
    not (RECORDING.exists() and YARDSTICK.exists()),
    reason="the recordings of others do not lie beside the project, in ../shared",
)


def outcome(folder, *words):
    """Run a command; return its exit code, and the calibration in its folder with the sentences of its reasons."""
    code = run([*map(str, words), "-o", str(folder)])
    found = Calibration.load(folder / "calibration.json")
    reasons = {reason["code"]: reason["message"] for reason in found.quality["reasons"]}
    return SimpleNamespace(code=code, found=found, reasons=reasons, file=folder / "calibration.json")


def counts_of(archive, name, scales):
    """The int16 counts of a sensor and the code of its full scale: its own, or those of the smallest range."""
    if f"{name}_raw" in archive:
        return archive[f"{name}_raw"], int(np.argmin(np.abs(np.log(np.array(scales) / archive[f"{name}_scale"]))))
    code = next(code for code, scale in enumerate(scales) if np.abs(archive[name]).max() <= 32767 * scale)
    return np.rint(archive[name] / scales[code]), code


def make_capture(file, capture, gravity, poll_s):
    """Serve the recording's counts by a simulated chip, and record what crosses its bus."""
    with np.load(file) as archive:
        t = archive["t"]
        acc, accel = counts_of(archive, "acc", [reg.mps2_per_lsb(code) for code in range(4)])
        gyr, gyro = counts_of(archive, "gyr", [reg.rad_s_per_lsb(code) for code in range(4)])
    recorded_hz, base = (len(t) - 1) / (t[-1] - t[0]), reg.base_rate_hz(Config().dlpf)
    rate_hz = base / max(round(base / recorded_hz), 1)
    config = Config(reg.ACCEL_RANGES_G[accel], reg.GYRO_RANGES_DPS[gyro], rate_hz, poll_s=poll_s)
    error_ppm = 1e6 * (recorded_hz / rate_hz - 1)
    bus = open_recorded(acc, gyr, rate_hz, config.accel_range_g, config.gyro_range_dps, rate_error_ppm=error_ppm)
    with open_runner(OpenedChip(bus, Plan(config, gravity, until_end=True)), capture, console(quiet=True)) as runner:
        runner.record(None)
    return config


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The recording as a register capture."""
    path = tmp_path_factory.mktemp("real") / "capture.mcap"
    config = make_capture(RECORDING, path, 9.80665, LONG_POLL_S)
    assert (config.accel_range_g, config.gyro_range_dps, config.rate_hz) == (2, 250, 100)
    assert len(load(path)) == 10242
    return path


@pytest.fixture(scope="module")
def session(capture):
    """A session like any other."""
    return outcome(capture.parent / "board", "session", "--replay", capture)


@pytest.fixture(scope="module")
def by_accel(capture):
    """Result by the model that knows no hand and trusts the gyroscope."""
    return outcome(capture.parent / "accel", "calibrate", capture, "--model", "accel")


def transported_deg(*words, recording=RECORDING):
    """Median angle [deg] between gravity as the gyroscope carries it and as the accelerometer says."""
    command = [sys.executable, YARDSTICK, recording, *words, "--json"]
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["median_deg"]


def test_the_session_has_reservations_and_names_them(session):
    assert session.code in (0, 5)
    assert session.found.verdict in ("usable", "refused")
    assert session.found.fit["samples"] == 10242
    assert "in 18 samples" in session.reasons["gyro_clipped"]
    assert "turn more slowly, or choose a larger range" in session.reasons["gyro_clipped"]


def test_a_model_without_a_hand_says_that_it_does_not_explain_the_data(by_accel):
    assert by_accel.found.verdict in ("usable", "refused")
    assert by_accel.found.fit["nis"] > 100
    assert {"gyro_clipped", "inconsistent"} <= by_accel.reasons.keys()


def test_the_gyroscope_carries_gravity_to_where_the_accelerometer_finds_it(session, by_accel):
    assert transported_deg() > 8
    assert transported_deg(session.file) <= 0.6
    assert transported_deg(by_accel.file) <= 1.3


def test_parameters_that_no_pose_shows_have_large_standard_deviations(session):
    """Poses that never tilt x and y together do not determine their cross-axis terms by |a|."""
    D_std = session.found.D_std
    assert D_std[0, 1] > 5 * D_std[0, 0]
    assert D_std[1, 0] > 5 * D_std[1, 1]
    assert session.found.b_a[2] == pytest.approx(-1.1, abs=0.02)


@pytest.mark.parametrize(("name", "most_deg"), [("mpu9150_a", 0.1), ("imucal_session", 0.15)])
@pytest.mark.slow
def test_a_recording_of_unguided_motion_is_calibrated(tmp_path, name, most_deg):
    """Use recordings that lie flat for less than ten seconds; those of the MPU-9150s begin with spikes to 74 m/s^2."""
    recording = RECORDINGS / f"{name}.npz"
    make_capture(recording, tmp_path / "capture.mcap", 9.81, LONG_POLL_S)
    found = outcome(tmp_path / "board", "session", "--replay", tmp_path / "capture.mcap")
    assert found.code == 0 and found.found.verdict in ("good", "usable")
    assert transported_deg(found.file, "--trim", 0.5, "--gravity", 9.81, recording=recording) <= most_deg
