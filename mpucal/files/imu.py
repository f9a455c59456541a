"""Samples as sensor_msgs/msg/Imu in an MCAP file, which ROS 2 and Foxglove read.

CDR, little-endian (OMG DDS-XTypes 1.3, section 7.4): after the four bytes of its header every number lies at a
multiple of its size, counted from there. With one frame_id all messages have the same layout.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from ..clocks import S
from ..data import Samples, Vector
from ..disk.atomic import atomic_file
from ..errors import RecordingError
from .mcap import CALIBRATED
from .rows import Rows, Write

TOPIC, FRAME_ID = "/imu/data", "imu"
# sensor_msgs/Imu: a first covariance of -1 means no such measurement
NOT_MEASURED = -1.0

MESSAGE = np.dtype(
    [
        ("cdr", "V4"),
        ("sec", "<i4"),
        ("nanosec", "<u4"),
        ("frame_id_size", "<u4"),
        ("frame_id", "S4"),
        ("orientation", "<f8", 4),
        ("orientation_covariance", "<f8", 9),
        ("angular_velocity", "<f8", 3),
        ("angular_velocity_covariance", "<f8", 9),
        ("linear_acceleration", "<f8", 3),
        ("linear_acceleration_covariance", "<f8", 9),
    ]
)
SCHEMA = """\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def encode_messages(samples: Samples, noise: Vector, utc_ns: int = 0) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """Return times (n,) [ns] and messages (n,), each the CDR bytes of a sample; `noise` as of Rows, `utc_ns` at t = 0.

    Raises
    ------
    RecordingError : a time that a message cannot hold.
    """
    if not (np.isfinite(samples.t) & (samples.t >= 0.0) & (samples.t + utc_ns / S < 2.0**31 - 1)).all():
        raise RecordingError("a message of ROS can only hold times from 0 to 2^31 s", "write a .csv or .npz")
    t_ns = np.rint(samples.t * S).astype(np.int64) + utc_ns
    rows = np.zeros(len(samples), MESSAGE)
    rows["cdr"] = np.void(b"\0\1\0\0")
    rows["sec"], rows["nanosec"] = t_ns // S, t_ns % S
    rows["frame_id"], rows["frame_id_size"] = FRAME_ID.encode(), len(FRAME_ID) + 1
    rows["orientation"][:, 3] = 1.0
    rows["orientation_covariance"][:, 0] = NOT_MEASURED
    # zeros mean that it is not known
    acc_covariance, gyr_covariance = (np.diag(np.nan_to_num(std**2)).ravel() for std in noise)
    rows["linear_acceleration_covariance"] = acc_covariance
    rows["angular_velocity_covariance"] = gyr_covariance
    for key, values in (("angular_velocity", samples.gyr), ("linear_acceleration", samples.acc)):
        measured = np.asarray(np.isfinite(values).all(axis=1))
        rows[f"{key}_covariance"][~measured, 0] = NOT_MEASURED
        rows[key] = np.where(measured[:, None], values, 0.0)
    return t_ns, rows


@contextmanager
def imu_file(path: Path, rows: Rows, done: str) -> Iterator[Write]:
    """Open an MCAP file of Imu messages on TOPIC, with `done` as its metadata; see open_writer.

    Stamps are times of day if these are known, as on every robot, and else the recording's own times.
    """
    utc_ns, size = rows.utc_ns or 0, MESSAGE.itemsize
    with atomic_file(path) as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start("ros2", f"{CALIBRATED} {version('mpucal')}")
        writer.add_metadata(CALIBRATED, {"done": done})
        schema = writer.register_schema("sensor_msgs/msg/Imu", SchemaEncoding.ROS2, SCHEMA.encode())
        channel = writer.register_channel(TOPIC, MessageEncoding.CDR, schema)

        def write(samples: Samples) -> None:
            times, messages = encode_messages(samples, rows.noise, utc_ns)
            data = messages.tobytes()
            for at, t_ns in enumerate(times.tolist()):
                writer.add_message(channel, t_ns, data[at * size : (at + 1) * size], t_ns)

        yield write
        writer.finish()
