"""ArduPilot's dataflash logs become recordings of every IMU, and what is damaged is refused in a sentence."""

import struct
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import mpucal
from mpucal.errors import RecordingError, UsageError
from mpucal.mavlink.parameters.document import calibrate_vehicle

D = np.array([[1.02, 0.003, 0.0], [0.0, 0.99, -0.004], [0.002, 0.0, 0.97]])
B_A = np.array([-0.2, 0.3, 0.25])


def turned(D, b_a, seconds=40.0, hz=50.0):
    """Return t [s], acc, gyr of a sensor with known D and b_a, flat first and then turned about varied axes."""
    t = np.arange(round(seconds * hz)) / hz
    moving = np.clip((t - 8.0) / 1.0, 0.0, 1.0)[:, None]
    w = moving * np.stack([1.1 * np.sin(0.9 * t), 0.9 * np.sin(0.53 * t + 1.0), 0.8 * np.cos(0.31 * t)], axis=1)
    turns = Rotation.from_rotvec(0.5 * (w + np.vstack([w[1:], w[-1:]])) / hz)
    R, down = Rotation.identity(), np.zeros((len(t), 3))
    for k in range(len(t)):
        down[k] = R.apply([0.0, 0.0, -9.80665], inverse=True)
        R = R * turns[k]
    noise = np.random.default_rng(4)
    acc = down @ np.asarray(D).T + b_a + noise.normal(0.0, 0.02, (len(t), 3))
    return t, acc, w + noise.normal(0.0, 0.001, (len(t), 3)) + [0.004, -0.003, 0.002]


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
def flight(dataflash, tmp_path):
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
    assert len(recording) == len(recording.others[0]) == 2000
    calibration = calibrate_vehicle(recording)
    np.testing.assert_allclose(calibration.D, D, atol=1e-3)
    np.testing.assert_allclose(calibration.b_a, B_A, atol=5e-3)
    (other,) = calibration.extra["others"]
    np.testing.assert_allclose(other["accelerometer"]["D"], np.eye(3), atol=1e-3)
    assert calibration.extra["autopilot"]["params_old"]["INS_ACCOFFS_X"] == pytest.approx(0.05)


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


def test_files_that_hold_no_imu_say_what_to_do(dataflash, tmp_path):
    dataflash.add("PARM", 0, b"INS_ACCOFFS_X", 0.05, 0.0)
    for content, says in (
        (dataflash.bytes(), "holds no IMU messages: have LOG_BITMASK"),
        (b"MPUC" + bytes(100), "not a dataflash log"),
    ):
        (tmp_path / "x.bin").write_bytes(content)
        with pytest.raises(RecordingError, match=says):
            mpucal.load(tmp_path / "x.bin")
    (tmp_path / "x.bin").write_bytes(dataflash.bytes())
    with pytest.raises(UsageError, match="is a dataflash log of ArduPilot: leave out"):
        mpucal.load(tmp_path / "x.bin", rate=100)


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


def test_skipped_bytes_are_not_printed(dataflash, tmp_path, capfd):
    for k in range(100):
        dataflash.add("IMU", 1_000_000 + 20_000 * k, 0, 0, 0, 0, 0, 0, -9.8, 0, 0, 30.0, 1, 1, 50, 50)
    whole = dataflash.bytes()
    (tmp_path / "x.bin").write_bytes(whole + bytes(600) + whole)
    assert len(mpucal.load(tmp_path / "x.bin")) == 100
    (tmp_path / "x.bin").write_bytes(b"\xa3\x95\x80" + bytes(700))
    with pytest.raises(RecordingError):
        mpucal.load(tmp_path / "x.bin")
    assert capfd.readouterr() == ("", "")
