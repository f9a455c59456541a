"""Bags written by rosbags, and read."""

import json

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from mpucal.errors import CaptureError, RecordingError
from mpucal.files import load, open_rows, open_writer
from mpucal.files.hints import Hints
from mpucal.files.rows import Rows

S = 1_000_000_000
APART = (("/camera/accel/sample", True, False), ("/camera/gyro/sample", False, True))


def file_in(folder):
    return next(path for path in folder.iterdir() if path.suffix != ".yaml")


@pytest.mark.parametrize("kind", ["mcap", "db3", "bag"])
def test_bags_give_the_samples_that_were_written(write_bag, kind, walk, walk_ns, assert_same, tmp_path):
    made = write_bag(tmp_path / ("walk.bag" if kind == "bag" else "walk"), walk, walk_ns, kind)
    read = load(made)
    assert_same(read, walk, 0, 0)
    assert read.utc_ns == walk_ns[0]
    assert "times in ns, accelerations in m/s^2 and rates in rad/s" in read.taken
    assert "/imu/data_raw" in read.taken
    if kind != "bag":
        assert_same(load(file_in(made)), walk, 0, 0)
        assert_same(open_rows(file_in(made)).recording(), walk, 0, 0)


def test_a_bag_of_ros_1_that_was_made_an_mcap_file(ros1, encode_imu, walk, walk_ns, assert_same, tmp_path):
    """Read what `mcap convert` makes of a bag."""
    path = tmp_path / "walk.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start("ros1", "mcap go v1")
        definition = ros1.generate_msgdef("sensor_msgs/msg/Imu")[0].encode()
        channel = writer.register_channel(
            "/imu0", "ros1", writer.register_schema("sensor_msgs/Imu", "ros1msg", definition)
        )
        for t, acc, gyr in zip(walk_ns.tolist(), walk.acc, walk.gyr, strict=True):
            data = encode_imu(ros1, t, acc, gyr)
            writer.add_message(channel, t, data, t)
        writer.finish()
    assert_same(load(path), walk, 0, 0)
    with pytest.raises(RecordingError, match="it has some on /imu0"):
        load(path, Hints(topic="/imu1"))


def test_g_is_told_from_mps2(write_bag, walk, walk_ns, assert_same, tmp_path):
    in_g = type(walk).from_arrays(walk.t, walk.acc / 9.80665, walk.gyr)
    read = load(write_bag(tmp_path / "walk", in_g, walk_ns, "mcap"))
    assert_same(read, walk)
    assert "accelerations in g" in read.taken


def test_degrees_where_radians_belong_are_refused(write_bag, walk, walk_ns, assert_same, tmp_path):
    made = write_bag(tmp_path / "walk", type(walk).from_arrays(walk.t, walk.acc, np.degrees(walk.gyr)), walk_ns, "mcap")
    with pytest.raises(RecordingError, match="--units gyr=rad/s or --units gyr=deg/s"):
        load(made)
    assert_same(load(made, Hints(units={"gyr": "deg/s"})), walk)


def test_headers_without_times_give_those_of_receipt(write_bag, walk, walk_ns, assert_same, tmp_path):
    read = load(write_bag(tmp_path / "walk", walk, walk_ns, "mcap", stamped=False))
    assert_same(read, walk, 0, 0)
    assert "of receipt" in read.taken


def test_two_topics_are_joined_by_time(write_bag, walk, walk_ns, tmp_path):
    late = 1_000_000
    read = load(write_bag(tmp_path / "walk", walk, walk_ns, "mcap", APART, gyro_late_ns=late))
    assert "from /camera/accel/sample and /camera/gyro/sample" in read.taken
    assert "the gyroscope begins +1.00 ms after the accelerometer" in read.taken
    wanted = np.column_stack([np.interp(read.t, walk.t + late * 1e-9, rate) for rate in walk.gyr.T])
    np.testing.assert_allclose(read.gyr, wanted, atol=1e-9)
    np.testing.assert_array_equal(read.acc, walk.acc[1:])


def test_of_several_topics_one_is_named(write_bag, walk, walk_ns, assert_same, tmp_path):
    made = write_bag(
        tmp_path / "walk", walk, walk_ns, "mcap", (("/imu/data_raw", True, True), ("/imu/data", True, True))
    )
    with pytest.raises(RecordingError, match=r"Imu on /imu/data_raw, /imu/data: choose one with --topic"):
        load(made)
    assert_same(load(made, Hints(topic="/imu/data")), walk, 0, 0)
    with pytest.raises(RecordingError, match="has no Imu on /other"):
        load(made, Hints(topic="/other"))


def test_a_bag_without_imus_names_its_topics(tmp_path):
    ros2 = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(tmp_path / "walk", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=ros2)
        text = ros2.types["std_msgs/msg/String"](data="hello")
        writer.write(connection, 1, ros2.serialize_cdr(text, "std_msgs/msg/String"))
    with pytest.raises(RecordingError, match="its topics are /chatter"):
        load(tmp_path / "walk")


@pytest.mark.parametrize("kind", ["mcap", "bag"])
def test_a_damaged_bag_is_refused(write_bag, kind, walk, walk_ns, tmp_path):
    made = write_bag(tmp_path / ("walk.bag" if kind == "bag" else "walk"), walk, walk_ns, kind)
    file = made if kind == "bag" else file_in(made)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(RecordingError):
        load(file)


def test_what_apply_wrote_is_read_and_not_calibrated_twice(walk, assert_same, tmp_path):
    with open_writer(tmp_path / "out.mcap", Rows(iter(())), "calibrated with c.json") as write:
        write(walk)
    read = load(tmp_path / "out.mcap")
    assert_same(read, walk, 0, 0)
    assert "its samples are calibrated with c.json already" in read.taken
    with pytest.raises(CaptureError, match="calibrated already"):
        open_rows(tmp_path / "out.mcap")


def test_the_command_says_what_was_taken(write_bag, walk, walk_ns, tmp_path, capfd):
    from mpucal.__main__ import run

    write_bag(tmp_path / "walk", walk, walk_ns, "mcap")
    # the walk is short, and may be refused
    assert run(["calibrate", str(tmp_path / "walk"), "--json"]) in (0, 5)
    said = capfd.readouterr()
    assert "mpucal: walk was read with times in ns" in said.err
    assert json.loads(said.out)["fit"]["samples"] == len(walk)
