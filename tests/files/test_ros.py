"""Bags written by rosbags, and read; and the .mcap that `apply` writes, read by rosbags."""

import json

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter

from mpucal.data import Recording
from mpucal.errors import RecordingError
from mpucal.files import load, open_rows, open_writer
from mpucal.files.hints import Hints
from mpucal.files.rows import Rows

ACC, GYR = ("/camera/accel/sample", True, False), ("/camera/gyro/sample", False, True)
TWO = (("/imu/data_raw", True, True), ("/imu/data", True, True))


def file_in(folder):
    return next(path for path in folder.iterdir() if path.suffix != ".yaml")


@pytest.mark.parametrize("kind", ["mcap", "db3", "bag"])
def test_bags_give_the_samples_that_were_written(write_bag, kind, walk, walk_ns, assert_same, tmp_path):
    made = write_bag(tmp_path / ("walk.bag" if kind == "bag" else "walk"), walk, walk_ns, kind)
    read = load(made)
    assert_same(read, walk, 0, 0)
    assert read.utc_ns == walk_ns[0]
    assert "times in ns, accelerations in m/s^2 and rates in rad/s; from /imu/data_raw" in read.taken
    file = made if kind == "bag" else file_in(made)
    assert_same(open_rows(file).recording(), walk, 0, 0)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(RecordingError):
        load(file)


@pytest.mark.parametrize(
    ("received_ns", "stamped", "says"),
    [
        (None, True, ""),
        ([], False, "holds 0 accelerations: record for longer"),
        (range(1 << 63, (1 << 63) + 40), False, "holds impossible times"),
    ],
    ids=["whole", "no messages", "times beyond any clock"],
)
def test_a_bag_of_ros_1_as_mcap_convert_makes_it(
    received_ns, stamped, says, ros1, encode_imu, walk, walk_ns, assert_same, tmp_path
):
    path = tmp_path / "walk.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start("ros1", "mcap go v1")
        definition = ros1.generate_msgdef("sensor_msgs/msg/Imu")[0].encode()
        schema = writer.register_schema("sensor_msgs/Imu", "ros1msg", definition)
        channel = writer.register_channel("/imu0", "ros1", schema)
        times = walk_ns.tolist() if received_ns is None else received_ns
        for t_ns, acc, gyr in zip(times, walk.acc, walk.gyr, strict=False):
            writer.add_message(channel, t_ns, encode_imu(ros1, t_ns * stamped, acc, gyr), t_ns)
        writer.finish()
    if says:
        with pytest.raises(RecordingError, match=says):
            load(path)
        return
    assert_same(load(path), walk, 0, 0)
    with pytest.raises(RecordingError, match="it has some on /imu0"):
        load(path, Hints(topic="/imu1"))


def test_units_are_those_that_the_samples_show(write_bag, walk, walk_ns, assert_same, tmp_path):
    in_g = type(walk).from_arrays(walk.t, walk.acc / 9.80665, walk.gyr)
    read = load(write_bag(tmp_path / "walk", in_g, walk_ns, "mcap"))
    assert_same(read, walk)
    assert "accelerations in g" in read.taken
    in_degrees = type(walk).from_arrays(walk.t, walk.acc, np.degrees(walk.gyr))
    made = write_bag(tmp_path / "other", in_degrees, walk_ns, "mcap")
    with pytest.raises(RecordingError, match="--units gyr=rad/s or --units gyr=deg/s"):
        load(made)
    assert_same(load(made, Hints(units={"gyr": "deg/s"})), walk)


def test_headers_without_times_give_those_of_receipt(write_bag, walk, walk_ns, assert_same, tmp_path):
    read = load(write_bag(tmp_path / "walk", walk, walk_ns, "mcap", stamped=False))
    assert_same(read, walk, 0, 0)
    assert "of receipt" in read.taken


def test_topics_are_joined_by_sensor_or_chosen_by_name(write_bag, walk, walk_ns, assert_same, tmp_path):
    read = load(write_bag(tmp_path / "walk", walk, walk_ns, "mcap", (ACC, GYR), gyro_late_ns=1_000_000))
    assert "from /camera/accel/sample and /camera/gyro/sample" in read.taken
    assert "the gyroscope begins +1.00 ms after the accelerometer" in read.taken
    np.testing.assert_array_equal(read.acc, walk.acc[1:])
    made = write_bag(tmp_path / "two", walk, walk_ns, "mcap", TWO)
    with pytest.raises(RecordingError, match=r"Imu on /imu/data_raw, /imu/data: choose one with --topic"):
        load(made)
    assert_same(load(made, Hints(topic="/imu/data")), walk, 0, 0)


def test_a_bag_without_imus_names_its_topics(tmp_path):
    with (tmp_path / "walk.mcap").open("wb") as file:
        writer = McapWriter(file)
        writer.start("ros1")
        writer.register_channel(
            "/chatter", "ros1", writer.register_schema("std_msgs/String", "ros1msg", b"string data")
        )
        writer.finish()
    with pytest.raises(RecordingError, match="its topics are /chatter"):
        load(tmp_path / "walk.mcap")


def test_output_of_apply_is_read_and_not_calibrated_twice(walk, assert_same, tmp_path):
    with open_writer(tmp_path / "out.mcap", Rows(iter(())), "calibrated with c.json") as write:
        write(walk)
    read = load(tmp_path / "out.mcap")
    assert_same(read, walk, 0, 0)
    assert "it is calibrated already (calibrated with c.json)" in read.taken
    assert open_rows(tmp_path / "out.mcap").done == "calibrated with c.json"


def test_the_command_says_what_was_taken(write_bag, walk, walk_ns, tmp_path, capfd):
    from mpucal.__main__ import run

    write_bag(tmp_path / "walk", walk, walk_ns, "mcap")
    # the walk is short, and may be refused
    assert run(["calibrate", str(tmp_path / "walk"), "--json"]) in (0, 5)
    said = capfd.readouterr()
    assert "mpucal: walk was read with times in ns" in said.err
    assert json.loads(said.out)["fit"]["samples"] == len(walk)


@pytest.mark.parametrize("gyr_noise", [[4.1e-5, 5e-7, 1e-3], [np.nan] * 3], ids=["known", "unknown of the gyroscope"])
def test_ros_reads_the_samples_and_the_covariances_of_their_noise(gyr_noise, tmp_path):
    from rosbags.highlevel import AnyReader

    noise, times = np.array([[0.02, 0.03, 0.04], gyr_noise]), np.array([0.25, 1.5])
    all_acc, all_gyr = np.random.default_rng(1).normal(size=(2, 2, 3))
    rows = Rows.of(Recording.from_arrays(times, all_acc, all_gyr))
    with open_writer(tmp_path / "out.mcap", Rows(iter(()), noise=noise), "done") as write:
        for samples in rows.runs:
            write(samples)
    with AnyReader([tmp_path / "out.mcap"]) as bag:
        found = [(of.topic, t_ns, bag.deserialize(data, of.msgtype)) for of, t_ns, data in bag.messages()]
    # zeros say that it is not known
    wanted = [np.diag(np.nan_to_num(std**2)).ravel() for std in noise]
    for (topic, t_ns, message), t_s, acc, gyr in zip(found, times, all_acc, all_gyr, strict=True):
        stamp, a, w = message.header.stamp, message.linear_acceleration, message.angular_velocity
        assert (topic, message.header.frame_id) == ("/imu/data", "imu")
        assert stamp.sec * 1_000_000_000 + stamp.nanosec == t_ns == round(t_s * 1e9)
        assert ([a.x, a.y, a.z], [w.x, w.y, w.z]) == (acc.tolist(), gyr.tolist())
        # there is no orientation
        assert message.orientation_covariance[0] == -1.0
        np.testing.assert_array_equal(message.linear_acceleration_covariance, wanted[0])
        np.testing.assert_array_equal(message.angular_velocity_covariance, wanted[1])
