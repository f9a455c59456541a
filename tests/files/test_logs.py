"""PX4's logs as pyulog writes them, and Parquet files as pandas does."""

import struct

import numpy as np
import pandas as pd
import pytest
from pyulog import ULog

from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import RecordingError
from mpucal.files import load
from mpucal.files.hints import Hints, parse_columns

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


def test_a_log_with_the_sensors_own_topics(walk, t_us, assert_same, tmp_path):
    path = ulog(
        tmp_path / "log.ulg",
        ("sensor_accel", 0, imu(t_us, walk.acc)),
        ("sensor_gyro", 0, imu(t_us, walk.gyr)),
        ("sensor_accel", 1, imu(t_us, walk.acc * 2)),
        ("sensor_combined", 0, combined(t_us, walk)),
    )
    read = load(path)
    assert_same(read, walk, 2e-6, 1e-6, 1e-6)
    assert "from sensor_accel and sensor_gyro" in read.taken
    assert "1 more accelerometers" in read.taken
    assert read.utc_ns is None


def test_a_log_with_sensor_combined_alone(walk, t_us, assert_same, tmp_path):
    path = ulog(tmp_path / "log.ulg", ("sensor_combined", 0, combined(t_us, walk)))
    read = load(path)
    assert_same(read, walk, 2e-6, 1e-6, 1e-6)
    assert "which PX4 has corrected by its parameters already" in read.taken


def test_a_log_whose_raw_topics_are_slow(walk, t_us, assert_same, tmp_path):
    """Read PX4's default log, which has sensor_accel and sensor_gyro once a second."""
    path = ulog(
        tmp_path / "log.ulg",
        ("sensor_accel", 0, imu(t_us[::100], walk.acc[::100])),
        ("sensor_gyro", 0, imu(t_us[::100], walk.gyr[::100])),
        ("sensor_combined", 0, combined(t_us, walk)),
    )
    read = load(path)
    assert_same(read, walk, 2e-6, 1e-6, 1e-6)
    assert "sensor_accel is logged too slowly" in read.taken


def test_accelerations_that_are_later_than_rates(walk, t_us, tmp_path):
    read = load(ulog(tmp_path / "log.ulg", ("sensor_combined", 0, combined(t_us, walk, -1500))))
    assert "the gyroscope begins +1.50 ms after" in read.taken
    unknown = load(ulog(tmp_path / "log.ulg", ("sensor_combined", 0, combined(t_us, walk, 0x7FFFFFFF))))
    assert len(unknown) == len(walk)


def test_a_log_without_imus(walk, t_us, tmp_path):
    path = ulog(tmp_path / "log.ulg", ("sensor_gyro", 0, imu(t_us, walk.gyr)))
    with pytest.raises(RecordingError, match="it has sensor_gyro: log them"):
        load(path)


@pytest.mark.parametrize("cut", [0, 3, 40])
def test_a_log_that_is_none(walk, t_us, cut, tmp_path):
    path = ulog(tmp_path / "log.ulg", ("sensor_combined", 0, combined(t_us, walk)))
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(RecordingError):
        load(path)


def parquet_of(walk, **more):
    return pd.DataFrame(
        {
            **more,
            **{f"acc_{axis}": walk.acc[:, i] / G for i, axis in enumerate("xyz")},
            **{f"gyr_{axis}": walk.gyr[:, i] for i, axis in enumerate("xyz")},
        }
    )


@pytest.mark.parametrize("kind", ["integers", "dates", "dates of no zone", "seconds"])
def test_a_parquet_file(kind, walk, walk_ns, assert_same, tmp_path):
    times = {
        "integers": walk_ns,
        "dates": pd.to_datetime(walk_ns, utc=True),
        "dates of no zone": pd.to_datetime(walk_ns),
        "seconds": walk.t,
    }[kind]
    parquet_of(walk, timestamp=times).to_parquet(tmp_path / "walk.parquet")
    read = load(tmp_path / "walk.parquet")
    assert_same(read, walk)
    assert "accelerations in g and rates in rad/s" in read.taken
    assert read.utc_ns == (walk_ns[0] if kind in ("integers", "dates") else None)


def test_an_index_of_dates_without_a_name(walk, walk_ns, assert_same, tmp_path):
    parquet_of(walk).set_index(pd.to_datetime(walk_ns, utc=True)).to_parquet(tmp_path / "walk.parquet")
    assert_same(load(tmp_path / "walk.parquet"), walk)


def test_its_columns_are_named(walk, assert_same, tmp_path):
    made = parquet_of(walk, when=walk.t)
    made.columns = ["when", *"abcdef"]
    made.to_parquet(tmp_path / "walk.parquet")
    read = load(tmp_path / "walk.parquet")
    assert_same(read, walk)
    assert "how gravity turns: --columns t,ax,ay,az,gx,gy,gz" in read.taken
    made[["when", *"adbecf"]].to_parquet(tmp_path / "walk.parquet")
    with pytest.raises(RecordingError, match="its columns are when, a, d, b, e, c, f"):
        load(tmp_path / "walk.parquet")
    named = Hints(columns=parse_columns("t=when,ax=a,ay=b,az=c,gx=d,gy=e,gz=f"))
    assert_same(load(tmp_path / "walk.parquet", named), walk)


def test_a_parquet_file_that_is_none(tmp_path):
    (tmp_path / "walk.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(RecordingError, match="not a whole file of arrays"):
        load(tmp_path / "walk.parquet")


@pytest.mark.parametrize(
    ("name", "extra"), [("log.ulg", "px4"), ("walk.parquet", "parquet"), ("walk.bag", "ros"), ("walk.db3", "ros")]
)
def test_a_library_that_is_missing_is_named(name, extra, tmp_path, monkeypatch):
    for module in ("pyulog", "pyarrow", "rosbags.highlevel"):
        monkeypatch.setitem(__import__("sys").modules, module, None)
    (tmp_path / name).touch()
    with pytest.raises(RecordingError, match=rf"pip install 'mpucal\[{extra}\]'"):
        load(tmp_path / name)


def test_a_damaged_log_says_so_in_what_was_taken_alone(walk, t_us, tmp_path, capsys):
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
