"""PX4's logs (.ulg), by pyulog: sensor_accel and sensor_gyro where they are logged fast enough, else sensor_combined.

Unless SDLOG_PROFILE asks for more, PX4 logs the former once a second (logged_topics.cpp) and the latter in full.
sensor_accel and sensor_gyro are as the driver delivers them; sensor_combined is the primary sensors' by PX4's
parameters, CAL_ACC0_XOFF and the like. Both in m/s^2, rad/s and us.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable
from contextlib import redirect_stdout
from dataclasses import replace
from io import BufferedReader, FileIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Recording, Vector
from ..errors import RecordingError
from .extras import library
from .hints import NO_HINTS, Hints
from .tables.streams import recording_of
from .tables.times import Stream
from .tables.units import SLOWEST_HZ

COMBINED, ACCEL, GYRO = "sensor_combined", "sensor_accel", "sensor_gyro"
# RELATIVE_TIMESTAMP_INVALID
INVALID = 0x7FFFFFFF
# a message's size and type
NO_MESSAGE, PAGE = bytes(3), 4096
_DAMAGE = (
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    struct.error,
    EOFError,
    MemoryError,
    OverflowError,
)


class _PastTheEnd(BufferedReader):
    """A file in which a read goes on by what it asked for at the end, too.

    pyulog goes back by that from a damaged message, and would read the same bytes for ever. Where there is no message
    but a page of zeros the log has ended: a hole of gigabytes, three bytes at a time, would take hours.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        """What there is."""
        data = super().read(size)
        if data == NO_MESSAGE and len(ahead := self.peek()) >= PAGE and not any(ahead):
            self.seek(0, os.SEEK_END)
            data = b""
        if size is not None and len(data) < size:
            self.seek(size - len(data), 1)
        return data


def load_ulog(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """The recording of the first IMU of a PX4's log, or of sensor_combined where `hints.topic` names that.

    Raises
    ------
    RecordingError : it cannot be read, or holds no such topics.
    """
    reader = library("pyulog", "px4", path)
    try:
        # it prints what it finds of damage, where results go
        with _PastTheEnd(FileIO(path)) as file, redirect_stdout(StringIO()):
            log = reader.ULog(file, [COMBINED, ACCEL, GYRO])
    except OSError as error:
        raise RecordingError(f"cannot read {path} ({error.strerror or error})", "check the path") from error
    except Exception as error:
        # it raises bare Exceptions, too
        raise RecordingError(f"{path} is no whole log of PX4 ({error})", "fetch it from the vehicle again") from error
    topics = {(data.name, data.multi_id): data.data for data in log.data_list}
    if hints.topic not in (None, COMBINED, ACCEL):
        raise RecordingError(f"{path.name} is read by {ACCEL} or {COMBINED}", f"give --topic {ACCEL} or {COMBINED}")
    raw = (ACCEL, 0) in topics and (GYRO, 0) in topics
    damage = ["it is damaged, and what is whole of it was read"] if log.file_corruption else []
    try:
        fast = raw and all(_is_fast(topics[name, 0]) for name in (ACCEL, GYRO))
        if raw and (hints.topic == ACCEL or (hints.topic is None and (fast or (COMBINED, 0) not in topics))):
            acc, gyr = (_stream(topics[n, 0], "xyz", unit) for n, unit in ((ACCEL, "m/s^2"), (GYRO, "rad/s")))
            others = sum(name == ACCEL for name, _ in topics) - 1
            more = [f"{others} more accelerometers are in it"] if others else []
            return recording_of(
                acc, gyr, hints, path.name, remarks=[f"from {ACCEL} and {GYRO}, the first of each", *more, *damage]
            )
        if (COMBINED, 0) in topics and hints.topic != ACCEL:
            combined = topics[COMBINED, 0]
            acc = _stream(combined, [f"accelerometer_m_s2[{axis}]" for axis in range(3)], "m/s^2")
            gyr = _stream(combined, [f"gyro_rad[{axis}]" for axis in range(3)], "rad/s")
            acc = replace(acc, times=np.asarray(acc.times) + _later_us(combined))
            slow = [f"{ACCEL} is logged too slowly"] if raw and not fast else []
            remark = f"from {COMBINED}, which PX4 has corrected by its parameters already"
            return recording_of(acc, gyr, hints, path.name, remarks=[remark, *slow, *damage])
    except _DAMAGE as error:
        raise RecordingError(f"{path} is no whole log of PX4 ({error})", "fetch it from the vehicle again") from error
    has = ", ".join(sorted({name for name, _ in topics})) or "none of them"
    raise RecordingError(
        f"{path.name} holds no {hints.topic or f'{ACCEL} with {GYRO}, and no {COMBINED}'}: it has {has}",
        "log them, with SDLOG_PROFILE",
    )


def _is_fast(data: Any) -> bool:
    steps = np.diff(np.asarray(data["timestamp"], np.int64))
    return len(steps) > 0 and float(np.median(steps)) * 1e-6 <= 1 / SLOWEST_HZ


def _stream(data: Any, names: Iterable[str], unit: str) -> Stream:
    # a driver that does not say when a sample was taken says 0; sensor_combined has no such field
    times = data.get("timestamp_sample", data["timestamp"])
    # a damaged log may call them fractions, and hold values that are none
    with np.errstate(invalid="ignore"):
        values: Vector = np.column_stack([np.asarray(data[name], float) for name in names])
        return Stream(np.asarray(times if np.all(times) else data["timestamp"], np.int64), values, "us", unit)


def _later_us(combined: Any) -> NDArray[np.int64]:
    """(n,) us by which sensor_combined's accelerations are later than its rates."""
    later = np.asarray(combined.get("accelerometer_timestamp_relative", 0), np.int64)
    return np.where(later == INVALID, 0, later)
