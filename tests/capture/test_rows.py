"""Samples that pass through a run at a time: what goes in comes out, of every kind; of a failure nothing is left."""

import csv
import struct

import numpy as np
import pytest
from mcap.reader import make_reader

from mpucal.capture import load
from mpucal.capture.npz import save_npz
from mpucal.capture.rows import ROWS, open_rows, open_writer
from mpucal.data import Recording, Samples, Sensor
from mpucal.errors import OutputError, RecordingError

N = ROWS + 1000


def recording(n=N, warm=True):
    rng = np.random.default_rng(4)
    return Recording.from_arrays(
        np.arange(n) * 0.005 + 3.25,
        rng.normal(size=(n, 3)),
        rng.normal(size=(n, 3)),
        (5, 200),
        temperature_c=rng.normal(30.0, 1.0, n) if warm else None,
        gap=np.arange(n) == 77,
        sensor=Sensor(chip="MPU-6050", who_am_i=0x68, accel_offsets=(1, 2, 3)),
    )


def through(source, target):
    rows = open_rows(source)
    runs = []
    with open_writer(target, rows, "nothing was done") as write:
        for samples in rows.runs:
            runs.append(len(samples))
            write(samples)
    return runs


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("rows") / "recording.npz"
    save_npz(recording(), path)
    return path


def test_an_archive_comes_out_as_it_went_in(archive, tmp_path):
    assert through(archive, tmp_path / "out.npz") == [ROWS, 1000]
    before, after = load(archive), load(tmp_path / "out.npz")
    for name in ("t", "acc", "gyr", "temperature_c", "gap", "acc_clipped", "gyr_clipped"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    assert (after.flat, after.sensor) == (before.flat, before.sensor)
    assert open_rows(tmp_path / "out.npz").done == "nothing was done"
    # numpy's own reader agrees, and reads no pickle
    with np.load(tmp_path / "out.npz", allow_pickle=False) as arrays:
        assert set(arrays.files) >= {"t", "acc", "gyr", "done"}


@pytest.mark.parametrize("warm", [True, False])
def test_a_table_comes_out_as_it_went_in(warm, tmp_path):
    before = recording(300, warm)
    save_npz(before, tmp_path / "in.npz")
    through(tmp_path / "in.npz", tmp_path / "out.csv")
    through(tmp_path / "out.csv", tmp_path / "again.csv")
    after = load(tmp_path / "again.csv")
    for name in ("t", "acc", "gyr", "temperature_c"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_a_table_with_everything_that_load_takes(tmp_path):
    text = '\ufeffGz,note,t,ax,ay,az,gx,gy\r\n6,"a, b",0,1,2,3,4,5\r\n\r\n12,,1,7,8,9,10,11\r\n'
    (tmp_path / "odd.csv").write_text(text, encoding="utf-8")
    (samples,) = open_rows(tmp_path / "odd.csv").runs
    whole = load(tmp_path / "odd.csv")
    for name in ("t", "acc", "gyr"):
        np.testing.assert_array_equal(getattr(samples, name), getattr(whole, name))


@pytest.mark.parametrize("line", [2, ROWS + 3])
def test_a_bad_line_is_named(line, tmp_path):
    rows = [[i, 1, 2, 3, 4, 5, 6] for i in range(ROWS + 10)]
    rows[line - 2][3] = "nonsense"
    with (tmp_path / "bad.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["t", "ax", "ay", "az", "gx", "gy", "gz"], *rows])
    with pytest.raises(RecordingError, match=f"line {line}: az is 'nonsense'"):
        list(open_rows(tmp_path / "bad.csv").runs)


def cdr(data):
    """sensor_msgs/Imu read number by number, as its definition says."""
    at = 4

    def take(kind):
        nonlocal at
        size = struct.calcsize(kind)
        at += -(at - 4) % size
        (value,) = struct.unpack_from("<" + kind, data, at)
        at += size
        return value

    stamp = take("i"), take("I")
    length = take("I")
    frame_id = data[at : at + length].rstrip(b"\0").decode()
    at += length
    numbers = [take("d") for _ in range(4 + 9 + 3 + 9 + 3 + 9)]
    assert at == len(data)
    assert data[:4] == b"\0\1\0\0"
    return stamp, frame_id, numbers


def test_ros_reads_what_was_written(tmp_path):
    before = recording(500)
    save_npz(before, tmp_path / "in.npz")
    through(tmp_path / "in.npz", tmp_path / "out.mcap")
    with (tmp_path / "out.mcap").open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        messages = list(reader.iter_messages())
    assert len(messages) == 500
    for i, (schema, channel, message) in enumerate(messages):
        assert (schema.name, schema.encoding) == ("sensor_msgs/msg/Imu", "ros2msg")
        assert (channel.topic, channel.message_encoding) == ("/imu/data", "cdr")
        (sec, nanosec), frame_id, numbers = cdr(message.data)
        assert sec * 1_000_000_000 + nanosec == message.log_time == round(before.t[i] * 1e9)
        assert frame_id == "imu"
        assert numbers[:4] == [0.0, 0.0, 0.0, 1.0]
        assert numbers[4] == -1.0
        assert numbers[13:16] == before.gyr[i].tolist()
        assert numbers[25:28] == before.acc[i].tolist()


@pytest.mark.parametrize("ending", [".csv", ".npz", ".mcap"])
def test_a_failure_leaves_the_old_file_and_no_other(ending, archive, tmp_path):
    target = tmp_path / f"out{ending}"
    target.write_text("old")
    rows = open_rows(archive)
    with pytest.raises(RecordingError), open_writer(target, rows, "") as write:
        write(next(rows.runs))
        raise RecordingError("the source failed", "try again")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_other_endings_are_refused(archive, tmp_path):
    with pytest.raises(OutputError, match=r"\.csv, \.npz, \.mcap"):
        open_writer(tmp_path / "out.txt", open_rows(archive), "")


def test_a_cut_archive_is_refused(archive, tmp_path):
    (tmp_path / "cut.npz").write_bytes(archive.read_bytes()[:-3000])
    with pytest.raises(RecordingError):
        list(open_rows(tmp_path / "cut.npz").runs)


def test_a_time_that_no_message_holds_is_refused(tmp_path):
    samples = Samples(*(getattr(recording(300), name) for name in Samples.__dataclass_fields__))
    samples.t[0] = -1.0
    with pytest.raises(RecordingError, match="time"), open_writer(tmp_path / "x.mcap", None, "") as write:
        write(samples)
