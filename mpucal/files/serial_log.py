"""Output of i2cdevlib's example MPU6050_raw: lines of `a/g:` and six counts, separated by tabs (MPU9150_raw: nine).

MPU6050::initialize() sets ±2 g and ±250 deg/s, and the example prints no times.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..data import Recording
from ..errors import RecordingError
from .hints import NO_HINTS, Hints
from .reading import first_bytes, reading
from .tables.streams import join_streams
from .tables.times import Stream
from .tables.units import COUNTS

LINE = re.compile(
    rb"^[^\n]{0,40}?a/g(?:/m)?:((?:[ \t]+-?[0-9]{1,6}){6})(?:[ \t]+-?[0-9]{1,6}){0,3}[ \t\r]*$", re.MULTILINE
)
ACCEL_RANGE_G, GYRO_RANGE_DPS = 2.0, 250.0
SNIFFED = 1 << 14


def is_serial_log(path: Path) -> bool:
    """Return True if a file begins with such lines."""
    return LINE.search(first_bytes(path, SNIFFED)) is not None


def load_serial_log(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in such lines; other lines are left out, and so is a torn last line.

    Raises
    ------
    RecordingError : it cannot be read, holds no such lines, or the rate is not known.
    """
    with reading(path):
        data = path.read_bytes()
    whole = data if data.endswith(b"\n") else data[: data.rfind(b"\n") + 1]
    rows = [line.split() for line in LINE.findall(whole)]
    if not rows:
        raise RecordingError(f"{path} holds no lines of MPU6050_raw", "give the output of that sketch")
    counts = np.array(rows, float)
    remarks = []
    if hints.accel_range_g is None and hints.gyro_range_dps is None:
        hints = replace(hints, accel_range_g=ACCEL_RANGE_G, gyro_range_dps=GYRO_RANGE_DPS)
        remarks.append("the ranges are those that MPU6050::initialize() sets")
    acc, gyr = (Stream(None, values, unit=COUNTS) for values in (counts[:, :3], counts[:, 3:]))
    return join_streams(acc, gyr, hints, path.name, remarks=remarks)
