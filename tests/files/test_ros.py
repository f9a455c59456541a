"""Bags written by rosbags, and read."""

import json

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from mpucal.errors import CaptureError, RecordingError
from mpucal.files import load, open_rows, open_writer
from mpucal.files.hints import Hints
from mpucal.files.rows import Rows

ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
S = 1_000_000_000
BOTH = (("/imu/data_raw", True, True),)
APART = (("/camera/accel/sample", True, False), ("/camera/gyro/sample", False, True))


def message(store, t_ns, acc, gyr):
    kinds = store.types
    vector, covariance = kinds["geometry_msgs/msg/Vector3"], np.zeros(9)
    unknown = np.array([-1.0, *[0.0] * 8])
    stamp = kinds["builtin_interfaces/msg/Time"](sec=int(t_ns // S), nanosec=int(t_ns % S))
    more = {"seq": 0} if store is ROS1 else {}
    return kinds["sensor_msgs/msg/Imu"](
        header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **more),
        orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=unknown,
        angular_velocity=vector(*(float(v) for v in gyr)),
        angular_velocity_covariance=covariance,
        linear_acceleration=vector(*(float(v) for v in acc)),
        linear_acceleration_covariance=covariance,
    )


def bag(path, walk, t_ns, kind, topics=BOTH, stamped=True, gyro_late_ns=0):
    """The walk on topics, of which each says whether it holds accelerations and rates."""
    store = ROS1 if kind == "bag" else ROS2
    plugin = StoragePlugin.SQLITE3 if kind == "db3" else StoragePlugin.MCAP
    writer = Writer1(path) if kind == "bag" else Writer2(path, version=9, storage_plugin=plugin)
    with writer:
        for topic, has_acc, has_gyr in topics:
            connection = writer.add_connection(topic, "sensor_msgs/msg/Imu", typestore=store)
            for t, acc, gyr in zip(t_ns.tolist(), walk.acc, walk.gyr, strict=True):
                late = t if has_acc else t + gyro_late_ns
                made = message(store, late if stamped else 0, acc * has_acc, gyr * has_gyr)
                serialize = store.serialize_ros1 if store is ROS1 else store.serialize_cdr
                writer.write(connection, late, serialize(made, "sensor_msgs/msg/Imu"))
    return path


def file_in(folder):
    return next(path for path in folder.iterdir() if path.suffix != ".yaml")


@pytest.mark.parametrize("kind", ["mcap", "db3", "bag"])
def test_bags_give_the_samples_that_were_written(kind, walk, walk_ns, assert_same, tmp_path):
    made = bag(tmp_path / ("walk.bag" if kind == "bag" else "walk"), walk, walk_ns, kind)
    read = load(made)
    assert_same(read, walk, 0, 0)
    assert read.utc_ns == walk_ns[0]
    assert "times in ns, accelerations in m/s^2 and rates in rad/s" in read.taken
    assert "/imu/data_raw" in read.taken
    if kind != "bag":
        assert_same(load(file_in(made)), walk, 0, 0)
        assert_same(open_rows(file_in(made)).recording(), walk, 0, 0)


def test_a_bag_of_ros_1_that_was_made_an_mcap_file(walk, walk_ns, assert_same, tmp_path):
    """Read what `mcap convert` makes of a bag."""
    path = tmp_path / "walk.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start("ros1", "mcap go v1")
        definition = ROS1.generate_msgdef("sensor_msgs/msg/Imu")[0].encode()
        channel = writer.register_channel(
            "/imu0", "ros1", writer.register_schema("sensor_msgs/Imu", "ros1msg", definition)
        )
        for t, acc, gyr in zip(walk_ns.tolist(), walk.acc, walk.gyr, strict=True):
            data = bytes(ROS1.serialize_ros1(message(ROS1, t, acc, gyr), "sensor_msgs/msg/Imu"))
            writer.add_message(channel, t, data, t)
        writer.finish()
    assert_same(load(path), walk, 0, 0)
    with pytest.raises(RecordingError, match="it has some on /imu0"):
        load(path, Hints(topic="/imu1"))


def test_g_is_told_from_mps2(walk, walk_ns, assert_same, tmp_path):
    in_g = type(walk).from_arrays(walk.t, walk.acc / 9.80665, walk.gyr)
    read = load(bag(tmp_path / "walk", in_g, walk_ns, "mcap"))
    assert_same(read, walk)
    assert "accelerations in g" in read.taken


def test_degrees_where_radians_belong_are_refused(walk, walk_ns, assert_same, tmp_path):
    made = bag(tmp_path / "walk", type(walk).from_arrays(walk.t, walk.acc, np.degrees(walk.gyr)), walk_ns, "mcap")
    with pytest.raises(RecordingError, match="--units gyr=rad/s or --units gyr=deg/s"):
        load(made)
    assert_same(load(made, Hints(units={"gyr": "deg/s"})), walk)


def test_headers_without_times_give_those_of_receipt(walk, walk_ns, assert_same, tmp_path):
    read = load(bag(tmp_path / "walk", walk, walk_ns, "mcap", stamped=False))
    assert_same(read, walk, 0, 0)
    assert "of receipt" in read.taken


def test_two_topics_are_joined_by_time(walk, walk_ns, tmp_path):
    late = 1_000_000
    read = load(bag(tmp_path / "walk", walk, walk_ns, "mcap", APART, gyro_late_ns=late))
    assert "from /camera/accel/sample and /camera/gyro/sample" in read.taken
    assert "the gyroscope begins +1.00 ms after the accelerometer" in read.taken
    wanted = np.column_stack([np.interp(read.t, walk.t + late * 1e-9, rate) for rate in walk.gyr.T])
    np.testing.assert_allclose(read.gyr, wanted, atol=1e-9)
    np.testing.assert_array_equal(read.acc, walk.acc[1:])


def test_of_several_topics_one_is_named(walk, walk_ns, assert_same, tmp_path):
    made = bag(tmp_path / "walk", walk, walk_ns, "mcap", (*BOTH, ("/imu/data", True, True)))
    with pytest.raises(RecordingError, match=r"Imu on /imu/data_raw, /imu/data: choose one with --topic"):
        load(made)
    assert_same(load(made, Hints(topic="/imu/data")), walk, 0, 0)
    with pytest.raises(RecordingError, match="has no Imu on /other"):
        load(made, Hints(topic="/other"))


def test_a_bag_without_imus_names_its_topics(tmp_path):
    with Writer2(tmp_path / "walk", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=ROS2)
        text = ROS2.types["std_msgs/msg/String"](data="hello")
        writer.write(connection, 1, ROS2.serialize_cdr(text, "std_msgs/msg/String"))
    with pytest.raises(RecordingError, match="its topics are /chatter"):
        load(tmp_path / "walk")


@pytest.mark.parametrize("kind", ["mcap", "db3", "bag"])
def test_a_damaged_bag_is_refused(kind, walk, walk_ns, tmp_path):
    made = bag(tmp_path / ("walk.bag" if kind == "bag" else "walk"), walk, walk_ns, kind)
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


def test_the_command_says_what_was_taken(walk, walk_ns, tmp_path, capfd):
    from mpucal.__main__ import run

    bag(tmp_path / "walk", walk, walk_ns, "mcap")
    assert run(["calibrate", str(tmp_path / "walk"), "--json"]) == 0
    said = capfd.readouterr()
    assert "mpucal: walk was read with times in ns" in said.err
    assert json.loads(said.out)["fit"]["samples"] == len(walk)
