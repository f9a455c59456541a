"""PX4's logs as pyulog writes them."""

import struct

import numpy as np
import pytest
from pyulog import ULog

from mpucal.errors import RecordingError
from mpucal.files import load

FORMATS = {
    "sensor_accel": "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;",
    "sensor_gyro": "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;",
    "sensor_combined": (
        "uint64_t timestamp;float[3] gyro_rad;int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
    ),
}
AN_IMU = struct.Struct("<HQQI3f")
COMBINED = struct.Struct("<HQ3fi3f")


def of_kind(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog(path, *topics):
    """A log by the format's page (docs.px4.io, ULog File Format), which pyulog reads and writes anew."""
    names = list(dict.fromkeys(name for name, _, _ in topics))
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), of_kind("B", bytes(40))]
    out += [of_kind("F", f"{name}:{FORMATS[name]}".encode()) for name in names]
    for number, (name, multi_id, _) in enumerate(topics):
        out.append(of_kind("A", struct.pack("<BH", multi_id, number) + name.encode()))
    out += [of_kind("D", row) for number, (_, _, rows) in enumerate(topics) for row in rows(number)]
    path.with_suffix(".made").write_bytes(b"".join(out))
    ULog(str(path.with_suffix(".made"))).write_ulog(str(path))
    return path


def imu(t_us, values, later=20):
    return lambda number: [
        AN_IMU.pack(number, t + later, t, 1310988, *row) for t, row in zip(t_us.tolist(), values, strict=True)
    ]


def combined(t_us, walk, relative=0):
    return lambda number: [
        COMBINED.pack(number, t, *w, relative, *a) for t, w, a in zip(t_us.tolist(), walk.gyr, walk.acc, strict=True)
    ]


@pytest.fixture
def t_us(walk):
    return np.rint(walk.t * 1e6).astype(np.int64) + 5_000_000


@pytest.mark.parametrize(
    ("every", "says"),
    [
        (1, "from sensor_accel and sensor_gyro, the first of each; 1 more accelerometers are in it"),
        (100, "sensor_accel is logged too slowly"),
        (None, "which PX4 has corrected by its parameters already"),
    ],
    ids=["raw topics", "raw topics once a second, as by default", "sensor_combined alone"],
)
def test_the_topics_that_are_fast_enough_are_read(every, says, walk, t_us, assert_same, tmp_path):
    raw = [
        ("sensor_accel", 0, imu(t_us[::every], walk.acc[::every])),
        ("sensor_gyro", 0, imu(t_us[::every], walk.gyr[::every])),
        ("sensor_accel", 1, imu(t_us, walk.acc * 2)),
    ]
    topics = [*(raw if every else []), ("sensor_combined", 0, combined(t_us, walk))]
    read = load(ulog(tmp_path / "log.ulg", *topics))
    assert_same(read, walk, 2e-6, 1e-6, 1e-6)
    assert says in read.taken
    assert read.utc_ns is None


def test_accelerations_that_are_later_than_rates(walk, t_us, tmp_path):
    read = load(ulog(tmp_path / "log.ulg", ("sensor_combined", 0, combined(t_us, walk, -1500))))
    assert "the gyroscope begins +1.50 ms after" in read.taken
    unknown = load(ulog(tmp_path / "log.ulg", ("sensor_combined", 0, combined(t_us, walk, 0x7FFFFFFF))))
    assert len(unknown) == len(walk)


def test_files_that_are_no_log_are_refused(walk, t_us, tmp_path):
    path = ulog(tmp_path / "log.ulg", ("sensor_gyro", 0, imu(t_us, walk.gyr)))
    with pytest.raises(RecordingError, match="it has sensor_gyro: log them"):
        load(path)
    whole = path.read_bytes()
    for cut in (0, 3, 40):
        path.write_bytes(whole[:cut])
        with pytest.raises(RecordingError):
            load(path)


def test_damage_of_a_log_is_reported_with_the_interpretation_alone(walk, t_us, tmp_path, capsys):
    path = ulog(tmp_path / "log.ulg", ("sensor_combined", 0, combined(t_us, walk)))
    data = bytearray(path.read_bytes())
    half = len(data) // 2
    data[half : half + 40] = bytes(40)
    path.write_bytes(data)
    assert "it is damaged" in load(path).taken
    assert capsys.readouterr().out == "", "results go there"


def test_a_log_that_ends_within_a_damaged_message_is_read_to_its_end(tmp_path):
    message = (51).to_bytes(2, "little") + b"\0" + bytes(50)
    (tmp_path / "log.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8) + message)
    with pytest.raises(RecordingError, match="holds no sensor_accel"):
        load(tmp_path / "log.ulg")
