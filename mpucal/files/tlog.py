"""MAVLink .tlog files as recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..data import Recording
from ..mavlink.log import read_log
from ..mavlink.tlog import TlogFile
from .budget import check_size


def load_tlog(path: Path) -> Recording:
    """Return the recording of the vehicle's first IMU in a .tlog, with the other IMUs in its `others`.

    Raises
    ------
    CaptureError : it cannot be read. RecordingError : it holds no vehicle, several, or no usable IMU.
    """
    # the file is mapped, and its pages count as memory
    check_size(path, path.stat().st_size)
    file = TlogFile(path)
    recording = read_log(file, file.name)
    return replace(recording, recovered=file.recovered)
