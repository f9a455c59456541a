"""The main job on what a real MPU-6050 measured: counts to registers, registers to a session, that to D and b_a."""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
SHARED = PROJECT.parent / "shared"
RECORDING = SHARED / "recordings" / "mpu6050_session.npz"
YARDSTICK = SHARED / "check" / "gravity_transport.py"

pytestmark = pytest.mark.skipif(
    not (RECORDING.exists() and YARDSTICK.exists()),
    reason="the recordings of others do not lie beside the project, in ../shared",
)


@dataclass(frozen=True)
class Outcome:
    code: int
    document: dict
    file: Path

    def reasons(self):
        return {reason["code"]: reason["message"] for reason in self.document["quality"]["reasons"]}


def call(*words):
    return subprocess.run([sys.executable, *map(str, words)], capture_output=True, text=True, check=False)


def outcome(folder, *words):
    done = call("-m", "mpucal", *words, "-o", folder, "--json")
    return Outcome(done.returncode, json.loads(done.stdout), folder / "calibration.json")


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The recording as a register capture."""
    path = tmp_path_factory.mktemp("real") / "capture.mcap"
    made = call(PROJECT / "tools" / "make_capture.py", RECORDING, "-o", path)
    assert made.returncode == 0, made.stderr
    assert "10242 of 10245 samples, ±2 g, ±250 deg/s, 100 Hz nominal" in made.stdout
    return path


@pytest.fixture(scope="module")
def session(capture):
    """A session like any other."""
    return outcome(capture.parent / "board", "session", "--replay", capture)


@pytest.fixture(scope="module")
def by_accel(capture):
    """The same by the model that knows no hand and trusts the gyroscope."""
    return outcome(capture.parent / "accel", "calibrate", capture, "--model", "accel")


def transported_deg(*words):
    """Median angle [deg] between gravity as the gyroscope carries it and as the accelerometer says; untrimmed."""
    done = call(YARDSTICK, RECORDING, *words, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["median_deg"]


def test_the_session_has_reservations_and_names_them(session):
    assert session.code in (0, 5)
    assert session.document["quality"]["verdict"] in ("usable", "refused")
    assert session.document["fit"]["samples"] == 10242
    assert "in 18 samples" in session.reasons()["gyro_clipped"]
    assert "turn more slowly, or choose a larger range" in session.reasons()["gyro_clipped"]


def test_a_model_without_a_hand_says_that_it_does_not_explain_the_data(by_accel):
    assert by_accel.document["quality"]["verdict"] in ("usable", "refused")
    assert by_accel.document["fit"]["nis"] > 100
    assert {"gyro_clipped", "inconsistent"} <= by_accel.reasons().keys()


def test_the_gyroscope_carries_gravity_to_where_the_accelerometer_finds_it(session, by_accel):
    assert transported_deg() > 8
    assert transported_deg(session.file) <= 1.3
    assert transported_deg(by_accel.file) <= 1.3
