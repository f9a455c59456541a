"""PX4's logs (.ulg), by pyulog: sensor_accel and sensor_gyro if they are logged fast enough, else sensor_combined.

Unless SDLOG_PROFILE asks for more, PX4 logs the former once a second (logged_topics.cpp) and the latter in full.
sensor_accel and sensor_gyro are the driver's output; sensor_combined is the output of the primary sensors, corrected
by PX4's parameters such as CAL_ACC0_XOFF. All are in m/s^2, rad/s and us.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable
from contextlib import AbstractContextManager, redirect_stdout
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
from .reading import import_extra, whole
from .tables.cells import since_first
from .tables.streams import join_streams
from .tables.times import Stream

COMBINED, ACCEL, GYRO = "sensor_combined", "sensor_accel", "sensor_gyro"


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
    if hints.topic not in (None, COMBINED, ACCEL):
        raise RecordingError(f"{path.name} is read from {ACCEL} or {COMBINED}", f"give --topic {ACCEL} or {COMBINED}")
    # pyulog raises bare Exceptions, too, and prints damage to stdout, which is for results
    with _whole(path, (Exception,)), _PastTheEnd(FileIO(path)) as file, redirect_stdout(StringIO()):
        log = reader.ULog(file, [COMBINED, ACCEL, GYRO])
    topics = {data.name: data.data for data in log.data_list if data.multi_id == 0}
    with _whole(path, (*DAMAGED, struct.error)):
        raw = {ACCEL, GYRO} <= topics.keys()
        fast = raw and all(_is_fast(topics[name]) for name in (ACCEL, GYRO))
        topic = hints.topic or (ACCEL if fast or COMBINED not in topics else COMBINED)
        if topic == ACCEL and raw:
            acc, gyr = _stream(topics[ACCEL], "xyz", "m/s^2"), _stream(topics[GYRO], "xyz", "rad/s")
            others = sum(data.name == ACCEL for data in log.data_list) - 1
            more = f"{others} more accelerometers are in it" if others else ""
            remarks = [f"from {ACCEL} and {GYRO}, the first of each", more]
        elif topic == COMBINED and COMBINED in topics:
            combined = topics[COMBINED]
            acc = _stream(combined, [f"accelerometer_m_s2[{axis}]" for axis in range(3)], "m/s^2", _later_us(combined))
            gyr = _stream(combined, [f"gyro_rad[{axis}]" for axis in range(3)], "rad/s")
            slow = f"{ACCEL} is logged too slowly" if raw and not fast else ""
            remarks = [f"from {COMBINED}, which PX4 has corrected by its parameters already", slow]
        else:
            has = ", ".join(sorted({data.name for data in log.data_list})) or "none of them"
            raise RecordingError(
                f"{path.name} holds no {hints.topic or f'{ACCEL} with {GYRO}, and no {COMBINED}'}: it has {has}",
                "log them, with SDLOG_PROFILE",
            )
        remarks.append("it is damaged, and its whole part was read" if log.file_corruption else "")
        return join_streams(acc, gyr, hints, path.name, remarks=remarks)


def _whole(path: Path, errors: tuple[type[Exception], ...]) -> AbstractContextManager[None]:
    return whole(path, "log of PX4", "fetch it from the vehicle again", errors)


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
