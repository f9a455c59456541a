"""A session's samples, and writers of tables and bags, by which tests write them as other programs do."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import mpucal

FIXTURE = Path(__file__).parents[2] / "fixtures" / "sessions" / "mpu6050.mcap"
EPOCH_NS = 1_403_636_579_758_555_392
IMU = "sensor_msgs/msg/Imu"
S = 1_000_000_000
BOTH = (("/imu/data_raw", True, True),)


@pytest.fixture(scope="session")
def walk():
    """A recording in which a hand turns the board, from t = 0 on, at an even 100 Hz, 10 s of it."""
    session, n = mpucal.load(FIXTURE), 1000
    # where it turns most about each axis, in whatever order the stored session took its orientations
    first = max(range(0, len(session) - n, 100), key=lambda k: np.ptp(session.acc[k : k + n], axis=0).min())
    whole = session.part(first, first + n)
    return mpucal.Recording.from_arrays(np.arange(len(whole)) / 100, whole.acc, whole.gyr, name="walk")


@pytest.fixture(scope="session")
def stored_calibration():
    """The first 50 s of a stored session, and their calibration."""
    whole = mpucal.load(FIXTURE, span=":50")
    return whole, mpucal.calibrate(whole)


@pytest.fixture(scope="session")
def walk_ns(walk):
    """Times of the walk, (n,) ns since 1970."""
    return np.rint(walk.t * 1e9).astype(np.int64) + EPOCH_NS


@pytest.fixture(scope="session")
def assert_same():
    """Return a check that samples are those of the walk, but for what the dialect rounds."""

    def check(read, walk, acc=1e-12, gyr=1e-12, t=1e-12):
        assert len(read) == len(walk)
        np.testing.assert_allclose(read.t - read.t[0], walk.t, rtol=0, atol=t)
        np.testing.assert_allclose(read.acc, walk.acc, rtol=0, atol=acc)
        np.testing.assert_allclose(read.gyr, walk.gyr, rtol=0, atol=gyr)

    return check


@pytest.fixture
def table(tmp_path):
    """Return a function that writes columns of numbers below their names, and returns the file's path."""

    def write(names, *columns, file="walk.csv"):
        made = np.column_stack(columns)
        np.savetxt(tmp_path / file, made, "%.17g", ",", header=names, comments="", encoding="utf-8")
        return tmp_path / file

    return write


@cache
def typestores():
    """Return the types of ROS 1 and of ROS 2, which take long to load."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)


def encode_imu_message(store, t_ns, acc, gyr):
    """Serialise a sensor_msgs/Imu message of ROS 1 or 2."""
    kinds, zeros = store.types, np.zeros(9)
    vector = kinds["geometry_msgs/msg/Vector3"]
    stamp = kinds["builtin_interfaces/msg/Time"](sec=int(t_ns // S), nanosec=int(t_ns % S))
    of_ros1 = store is typestores()[0]
    more = {"seq": 0} if of_ros1 else {}
    message = kinds[IMU](
        header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **more),
        orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.array([-1.0, *[0.0] * 8]),
        angular_velocity=vector(*(float(v) for v in gyr)),
        angular_velocity_covariance=zeros,
        linear_acceleration=vector(*(float(v) for v in acc)),
        linear_acceleration_covariance=zeros,
    )
    return bytes((store.serialize_ros1 if of_ros1 else store.serialize_cdr)(message, IMU))


def write_bag_file(path, walk, t_ns, kind, topics=BOTH, stamped=True, gyro_late_ns=0):
    """Write a bag; each topic says whether it holds accelerations and rates."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    store = typestores()[kind != "bag"]
    plugin = StoragePlugin.SQLITE3 if kind == "db3" else StoragePlugin.MCAP
    with Writer1(path) if kind == "bag" else Writer2(path, version=9, storage_plugin=plugin) as writer:
        for topic, has_acc, has_gyr in topics:
            connection = writer.add_connection(topic, IMU, typestore=store)
            for t, acc, gyr in zip(t_ns.tolist(), walk.acc, walk.gyr, strict=True):
                late = t if has_acc else t + gyro_late_ns
                writer.write(
                    connection, late, encode_imu_message(store, late if stamped else 0, acc * has_acc, gyr * has_gyr)
                )
    return path


@pytest.fixture(scope="session")
def encode_imu():
    """Return encode_imu_message."""
    return encode_imu_message


@pytest.fixture(scope="session")
def write_bag():
    """Return write_bag_file."""
    return write_bag_file


@pytest.fixture(scope="session")
def ros1():
    """Return the types of ROS 1."""
    return typestores()[0]
