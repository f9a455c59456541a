"""PX4's logs (.ulg), by pyulog: sensor_accel and sensor_gyro if they are logged fast enough, else sensor_combined.

Unless SDLOG_PROFILE asks for more, PX4 logs the former once a second (logged_topics.cpp) and the latter in full.
sensor_accel and sensor_gyro are the driver's output; sensor_combined is the output of the primary sensors, corrected
by PX4's parameters such as CAL_ACC0_XOFF. All are in m/s^2, rad/s and us.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable
from contextlib import redirect_stdout
from io import BufferedReader, FileIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..clocks.stamps import SLOWEST_HZ
from ..data import Recording, Vector
from ..errors import RecordingError
from .hints import NO_HINTS, Hints
from .npz import DAMAGED
from .reading import import_extra, reading
from .tables.cells import since_first
from .tables.streams import join_streams
from .tables.times import Stream

COMBINED, ACCEL, GYRO = "sensor_combined", "sensor_accel", "sensor_gyro"
_DAMAGE = (*DAMAGED, struct.error)


class _PastTheEnd(BufferedReader):
    """File whose position moves on by the requested size even past its end.

    pyulog goes back by that size from a damaged message, and would otherwise read the same bytes for ever. A page of
    zeros in place of a message is the end of the log: a hole of gigabytes, read by three bytes, would take hours.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        """Return at most `size` bytes."""
        data = super().read(size)
        # the size and the type of a message are three bytes
        if data == bytes(3) and len(ahead := self.peek()) >= 4096 and not any(ahead):
            self.seek(0, os.SEEK_END)
            data = b""
        if size is not None and len(data) < size:
            self.seek(size - len(data), 1)
        return data


def load_ulog(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording of the first IMU in a log of PX4, or of sensor_combined if `hints.topic` names that.

    Raises
    ------
    RecordingError : it cannot be read, or holds no such topics.
    """
    reader = import_extra("pyulog", "px4", path)
    try:
        # pyulog prints damage to stdout, which is for results
        with reading(path), _PastTheEnd(FileIO(path)) as file, redirect_stdout(StringIO()):
            log = reader.ULog(file, [COMBINED, ACCEL, GYRO])
    except RecordingError:
        raise
    except Exception as error:
        # pyulog raises bare Exceptions, too
        raise _damage_error(path, error) from error
    topics = {(data.name, data.multi_id): data.data for data in log.data_list}
    if hints.topic not in (None, COMBINED, ACCEL):
        raise RecordingError(f"{path.name} is read from {ACCEL} or {COMBINED}", f"give --topic {ACCEL} or {COMBINED}")
    raw = (ACCEL, 0) in topics and (GYRO, 0) in topics
    damage = "it is damaged, and its whole part was read" if log.file_corruption else ""
    try:
        fast = raw and all(_is_fast(topics[name, 0]) for name in (ACCEL, GYRO))
        if raw and (hints.topic == ACCEL or (hints.topic is None and (fast or (COMBINED, 0) not in topics))):
            acc, gyr = (_stream(topics[n, 0], "xyz", unit) for n, unit in ((ACCEL, "m/s^2"), (GYRO, "rad/s")))
            others = sum(name == ACCEL for name, _ in topics) - 1
            more = f"{others} more accelerometers are in it" if others else ""
            remark = f"from {ACCEL} and {GYRO}, the first of each"
            return join_streams(acc, gyr, hints, path.name, remarks=[remark, more, damage])
        if (COMBINED, 0) in topics and hints.topic != ACCEL:
            combined = topics[COMBINED, 0]
            names = [f"accelerometer_m_s2[{axis}]" for axis in range(3)]
            acc = _stream(combined, names, "m/s^2", _later_us(combined))
            gyr = _stream(combined, [f"gyro_rad[{axis}]" for axis in range(3)], "rad/s")
            slow = f"{ACCEL} is logged too slowly" if raw and not fast else ""
            remark = f"from {COMBINED}, which PX4 has corrected by its parameters already"
            return join_streams(acc, gyr, hints, path.name, remarks=[remark, slow, damage])
    except _DAMAGE as error:
        raise _damage_error(path, error) from error
    has = ", ".join(sorted({name for name, _ in topics})) or "none of them"
    raise RecordingError(
        f"{path.name} holds no {hints.topic or f'{ACCEL} with {GYRO}, and no {COMBINED}'}: it has {has}",
        "log them, with SDLOG_PROFILE",
    )


def _damage_error(path: Path, error: Exception) -> RecordingError:
    return RecordingError(f"{path} is not a whole log of PX4 ({error})", "fetch it from the vehicle again")


def _is_fast(data: Any) -> bool:
    steps = np.diff(np.asarray(data["timestamp"], np.int64))
    return len(steps) > 0 and float(np.median(steps)) * 1e-6 <= 1 / SLOWEST_HZ


def _stream(data: Any, names: Iterable[str], unit: str, later_us: NDArray[np.int64] | int = 0) -> Stream:
    # 0 means that the driver does not know the time of the sample; sensor_combined lacks the field
    times = data.get("timestamp_sample", data["timestamp"])
    # a damaged log may hold NaN, and times of another type
    with np.errstate(invalid="ignore"):
        values: Vector = np.column_stack([np.asarray(data[name], float) for name in names])
        ticks, origin = since_first(np.asarray(times if np.all(times) else data["timestamp"], np.int64) + later_us)
    return Stream(ticks, values, origin, "us", unit)


def _later_us(combined: Any) -> NDArray[np.int64]:
    """Return (n,) us by which sensor_combined's accelerations are later than its rates."""
    later = np.asarray(combined.get("accelerometer_timestamp_relative", 0), np.int64)
    # RELATIVE_TIMESTAMP_INVALID
    return np.where(later == np.iinfo(np.int32).max, 0, later)
