"""sensor_msgs/Imu in bags of ROS, by rosbags: rosbag2 as .mcap, .db3 or a folder of them, and ROS 1's .bag.

A driver that publishes the accelerometer and the gyroscope separately (RealSense: .../accel/sample, .../gyro/sample)
has two topics, which are joined by time. Some drivers publish g instead of m/s^2, which |a| shows.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Metadata

from ..clocks import S
from ..data import Recording
from ..errors import MpucalError, RecordingError
from .hints import NO_HINTS, Hints
from .imu import NOT_MEASURED
from .mcap import CALIBRATED, IMU, ROS1, profile
from .reading import first_bytes, import_extra
from .rows import Rows, describe_done
from .tables.cells import since_first
from .tables.shown_units import acceleration_unit
from .tables.streams import join_streams
from .tables.times import Stream

IMU_OF_ROS1 = "sensor_msgs/Imu"
REMEDY = "give a bag with sensor_msgs/Imu"
# quantity -> field of the message, and what it is
_FIELDS = {"acc": ("linear_acceleration", "acceleration"), "gyr": ("angular_velocity", "rate")}


def is_folder_of_ros(path: Path) -> bool:
    """Return True if a folder is a bag of rosbag2."""
    try:
        return "rosbag2_bagfile_information" in (path / "metadata.yaml").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False


def bag_rows(path: Path, hints: Hints = NO_HINTS) -> Rows:
    """Return the samples of a bag; see load_bag."""
    return Rows.of(load_bag(path, hints), _read_done(path))


def load_bag(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a bag.

    Raises
    ------
    RecordingError : rosbags is not installed, or the bag cannot be read, or holds no Imu or several.
    """
    highlevel, typesys = (import_extra(f"rosbags.{name}", "ros", path) for name in ("highlevel", "typesys"))
    try:
        if path.suffix.lower() == ".mcap" and profile(first_bytes(path)) == ROS1:
            topics, found = _read_ros1(path, typesys.get_typestore(typesys.Stores.ROS1_NOETIC), hints)
            return _recording(path, topics, found, hints)
        with highlevel.AnyReader([path], default_typestore=typesys.get_typestore(typesys.Stores.LATEST)) as bag:
            topics = _chosen(path.name, [c for c in bag.connections if c.msgtype == IMU], bag.topics, hints)
            found = {topic: _Messages() for topic in topics}
            for connection, t_ns, data in bag.messages(c for c in bag.connections if c.topic in topics):
                found[connection.topic].add(bag.deserialize(data, connection.msgtype), t_ns)
    except MpucalError:
        raise
    except Exception as error:
        # errors of sqlite, yaml, lz4 and others
        remedy = f"give its folder, {path.parent}" if is_folder_of_ros(path.parent) else REMEDY
        raise RecordingError(f"{path} is not a whole bag ({type(error).__name__}: {error})", remedy) from error
    return _recording(path, topics, found, hints)


def _read_ros1(path: Path, store: Any, hints: Hints) -> tuple[list[str], dict[str, _Messages]]:
    """Return topics and messages of a bag of ROS 1 that `mcap convert` made an MCAP file, which rosbags cannot read."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        if summary is None:
            raise RecordingError(f"{path} has no summary", "give it to `mcap recover`")
        there = list(summary.channels.values())
        imus = [channel for channel in there if summary.schemas[channel.schema_id].name == IMU_OF_ROS1]
        topics = _chosen(path.name, imus, [channel.topic for channel in there], hints)
        found = {topic: _Messages() for topic in topics}
        for _, channel, message in make_reader(file).iter_messages(topics=topics):
            found[channel.topic].add(store.deserialize_ros1(message.data, IMU), message.log_time)
    return topics, found


def _recording(path: Path, topics: list[str], found: dict[str, _Messages], hints: Hints) -> Recording:
    acc, gyr = found[topics[0]], found[topics[-1]]
    done = _read_done(path)
    remarks = [
        f"from {' and '.join(dict.fromkeys(topics))}",
        "" if acc.is_stamped else "times are those of receipt, as the headers hold none",
        describe_done("it", done) if done else "",
    ]
    return join_streams(acc.stream("acc", path.name), gyr.stream("gyr", path.name), hints, path.name, remarks=remarks)


def _chosen(name: str, connections: Iterable[Any], all_topics: Iterable[str], hints: Hints) -> list[str]:
    """Return the topic of both sensors, or those of the accelerometer and of the gyroscope."""
    there = list(dict.fromkeys(connection.topic for connection in connections))
    if hints.topic:
        asked = hints.topic.split(",")
        missing = [topic for topic in asked if topic not in there]
        if missing or len(asked) > 2:
            raise RecordingError(
                f"{name} has no Imu on {', '.join(missing or asked)}; it has some on {', '.join(there) or 'no topic'}",
                "name one with --topic, or two with a comma: the accelerometer's, the gyroscope's",
            )
        return asked
    if not there:
        raise RecordingError(f"{name} holds no {IMU}; its topics are {', '.join(all_topics) or 'none'}", REMEDY)
    words = (("accel", "gyro"), ("gyro", "accel"))
    apart = [[topic for topic in there if word in topic and other not in topic] for word, other in words]
    if len(there) == 2 and all(len(of) == 1 for of in apart):
        return [apart[0][0], apart[1][0]]
    if len(there) > 1:
        raise RecordingError(f"{name} holds Imu on {', '.join(there)}", "choose one with --topic")
    return there


class _Messages:
    """Messages of one topic."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._received: list[int] = []
        self._values: dict[str, list[tuple[float, float, float]]] = {of: [] for of in _FIELDS}
        self._not_measured: set[str] = set()

    def add(self, message: Any, t_ns: int) -> None:
        self._stamps.append(message.header.stamp.sec * S + message.header.stamp.nanosec)
        self._received.append(t_ns)
        for of, (field, _) in _FIELDS.items():
            value = getattr(message, field)
            self._values[of].append((value.x, value.y, value.z))
            if getattr(message, f"{field}_covariance")[0] == NOT_MEASURED:
                self._not_measured.add(of)

    @property
    def is_stamped(self) -> bool:
        return any(self._stamps)

    def stream(self, quantity: str, name: str) -> Stream:
        """Return the samples of a quantity."""
        times = self._stamps if self.is_stamped else self._received
        if times and max(times) >> 63:
            raise RecordingError(f"{name} holds impossible times", "give the bag as it was recorded")
        if quantity in self._not_measured:
            raise RecordingError(
                f"{name}: by their covariances, the messages hold no {_FIELDS[quantity][1]}",
                "name the topics of the accelerometer and of the gyroscope with --topic ONE,OTHER",
            )
        ticks, origin = since_first(np.array(times, np.int64))
        stream = Stream(ticks, np.array(self._values[quantity], float).reshape(-1, 3), origin, "ns", "rad/s")
        stream.values[~np.isfinite(stream.values)] = np.nan
        if quantity == "acc":
            seen = stream.complete.any() and acceleration_unit(stream.values[stream.complete])
            stream = replace(stream, unit=seen or "m/s^2")
        return stream


def _read_done(path: Path) -> str:
    """Return the processing of samples that `mpucal apply` wrote; empty for another file."""
    if path.suffix.lower() != ".mcap" or not path.is_file():
        return ""
    try:
        with path.open("rb") as file:
            found: list[Metadata] = [m for m in make_reader(file).iter_metadata() if m.name == CALIBRATED]
    except (McapError, OSError, struct.error, ValueError):
        return ""
    return found[0].metadata.get("done", "") if found else ""
