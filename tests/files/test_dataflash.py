"""ArduPilot's dataflash logs become recordings of every IMU, and what is damaged is refused in a sentence."""

from __future__ import annotations

import struct
from typing import ClassVar

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

import mpucal
from mpucal.cli import commands
from mpucal.errors import RecordingError
from mpucal.mavlink.calibrate_vehicle import calibrate_vehicle

D = np.array([[1.02, 0.003, 0.0], [0.0, 0.99, -0.004], [0.002, 0.0, 0.97]])
B_A = np.array([-0.2, 0.3, 0.25])


@pytest.fixture(scope="session")
def turned():
    """turned(n, hz): t [s], acc, gyr of a sensor with known D and b_a, flat first and then turned about varied axes."""

    def make(D, b_a, seconds=60.0, hz=50.0):
        t = np.arange(round(seconds * hz)) / hz
        moving = np.clip((t - 12.0) / 1.0, 0.0, 1.0)
        w = moving[:, None] * np.stack(
            [1.1 * np.sin(0.9 * t), 0.9 * np.sin(0.53 * t + 1.0), 0.8 * np.cos(0.31 * t)], axis=1
        )
        R, down = np.eye(3), np.zeros((len(t), 3))
        for k in range(len(t)):
            down[k] = R.T @ [0.0, 0.0, -9.80665]
            turn = 0.5 * (w[k] + w[min(k + 1, len(t) - 1)]) / hz
            angle = np.linalg.norm(turn)
            if angle:
                x, y, z = turn / angle
                K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
                R = R @ (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
        noise = np.random.default_rng(4)
        acc = down @ np.asarray(D).T + b_a + noise.normal(0.0, 0.02, (len(t), 3))
        return t, acc, w + noise.normal(0.0, 0.001, (len(t), 3)) + [0.004, -0.003, 0.002]

    return make


class Dataflash:
    """Writes ArduPilot's binary log: FMT messages that describe the others, then those."""

    TYPES: ClassVar = {"n": 4, "N": 16, "Z": 64}

    def __init__(self) -> None:
        self._data = bytearray()
        self._kinds: dict[str, tuple[int, str]] = {}

    def describe(self, name: str, kind: int, format_: str, columns: str) -> None:
        code = "<" + "".join(f"{self.TYPES[c]}s" if c in self.TYPES else c for c in format_)
        self._kinds[name] = (kind, code)
        fmt = struct.pack(
            "<BB4s16s64s", kind, 3 + struct.calcsize(code), name.encode(), format_.encode(), columns.encode()
        )
        self._data += b"\xa3\x95\x80" + fmt

    def add(self, name: str, *values) -> None:
        kind, code = self._kinds[name]
        self._data += b"\xa3\x95" + bytes([kind]) + struct.pack(code, *values)

    def bytes(self) -> bytes:
        return bytes(self._data)


@pytest.fixture
def dataflash() -> Dataflash:
    log = Dataflash()
    log.describe("FMT", 0x80, "BBnNZ", "Type,Length,Name,Format,Columns")
    log.describe("PARM", 0x81, "QNff", "TimeUS,Name,Value,Default")
    log.describe("IMU", 0x82, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz")
    return log


@pytest.fixture
def flight(dataflash, turned, tmp_path):
    """A log of two IMUs, the second a perfect one, and the offsets that the first one holds already."""
    t, acc, gyr = turned(D, B_A)
    _, perfect, _ = turned(np.eye(3), np.zeros(3))
    dataflash.add("PARM", 0, b"INS_ACCOFFS_X", 0.05, 0.0)
    for k in range(len(t)):
        t_us = 5_000_000 + round(t[k] * 1e6)
        for imu, a in enumerate((acc[k], perfect[k])):
            dataflash.add("IMU", t_us, imu, *gyr[k], *a, 0, 0, 31.5, 1, 1, 1000, 1000)
    path = tmp_path / "00000012.BIN"
    path.write_bytes(dataflash.bytes())
    return path


def test_every_imu_of_a_flight_is_calibrated(flight):
    recording = mpucal.load(flight)
    assert recording.autopilot.parameters["INS_ACCOFFS_X"] == pytest.approx(0.05)
    assert recording.sensor.temperature_c == pytest.approx(31.5)
    assert len(recording) == len(recording.others[0]) == 3000
    calibration = calibrate_vehicle(recording)
    np.testing.assert_allclose(calibration.D, D, atol=1e-3)
    np.testing.assert_allclose(calibration.b_a, B_A, atol=5e-3)
    (other,) = calibration.extra["others"]
    np.testing.assert_allclose(other["accelerometer"]["D"], np.eye(3), atol=1e-3)
    assert calibration.extra["autopilot"]["params_old"]["INS_ACCOFFS_X"] == pytest.approx(0.05)


def test_the_commands_take_a_log_for_what_it_is(flight):
    shown = CliRunner().invoke(commands, ["show", str(flight)])
    assert shown.exit_code == 0
    assert "3000 in 60.0 s" in shown.output


def test_a_log_with_a_message_for_each_imu_is_read(dataflash, tmp_path):
    columns = "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"
    dataflash.describe("IMU", 0x90, "Qffffff", columns)
    dataflash.describe("IMU2", 0x91, "Qffffff", columns)
    for k in range(200):
        dataflash.add("IMU", 1_000_000 + 20_000 * k, 0, 0, 0, 0, 0, -9.8)
        dataflash.add("IMU2", 1_000_000 + 20_000 * k, 0, 0, 0, 0, 0, -9.9)
    (tmp_path / "old.bin").write_bytes(dataflash.bytes())
    recording = mpucal.load(tmp_path / "old.bin")
    assert recording.acc[0, 2] == pytest.approx(-9.8)
    assert recording.others[0].acc[0, 2] == pytest.approx(-9.9)


def test_a_log_without_imu_messages_says_what_to_set(dataflash, tmp_path):
    dataflash.add("PARM", 0, b"INS_ACCOFFS_X", 0.05, 0.0)
    (tmp_path / "empty.bin").write_bytes(dataflash.bytes())
    with pytest.raises(RecordingError, match="holds no IMU messages: have LOG_BITMASK"):
        mpucal.load(tmp_path / "empty.bin")


def test_a_blob_is_no_log(tmp_path):
    (tmp_path / "calibration.bin").write_bytes(b"MPUC" + bytes(100))
    with pytest.raises(RecordingError, match="not a dataflash log"):
        mpucal.load(tmp_path / "calibration.bin")


@settings(max_examples=25)
@given(junk=st.binary(max_size=400), cut=st.integers(0, 400))
def test_damage_never_raises_anything_else(dataflash, tmp_path, junk, cut):
    for k in range(5):
        dataflash.add("IMU", 1_000_000 + 20_000 * k, 0, 0, 0, 0, 0, 0, -9.8, 0, 0, 30.0, 1, 1, 50, 50)
    whole = dataflash.bytes()
    (tmp_path / "x.bin").write_bytes(whole[: max(len(whole) - cut, 2)] + junk)
    try:
        mpucal.load(tmp_path / "x.bin")
    except RecordingError as error:
        assert error.remedy


def test_what_is_skipped_is_not_printed(dataflash, tmp_path, capfd):
    for k in range(100):
        dataflash.add("IMU", 1_000_000 + 20_000 * k, 0, 0, 0, 0, 0, 0, -9.8, 0, 0, 30.0, 1, 1, 50, 50)
    whole = dataflash.bytes()
    (tmp_path / "x.bin").write_bytes(whole + bytes(600) + whole)
    assert len(mpucal.load(tmp_path / "x.bin")) == 100
    (tmp_path / "x.bin").write_bytes(b"\xa3\x95\x80" + bytes(700))
    with pytest.raises(RecordingError):
        mpucal.load(tmp_path / "x.bin")
    assert capfd.readouterr() == ("", "")
