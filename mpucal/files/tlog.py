"""MAVLink .tlog files as recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..data import Recording
from ..mavlink.log import read_log
from ..mavlink.tlog import TlogFile
from .budget import afford


def load_tlog(path: Path) -> Recording:
    """The recording of the vehicle's first IMU in a .tlog, the others in its `others`.

    Raises
    ------
    CaptureError : it cannot be read. RecordingError : it holds no vehicle, several, or no IMU that tells the truth.
    """
    # its pages are mapped, and so count
    afford(path, path.stat().st_size)
    file = TlogFile(path)
    recording = read_log(file, file.name)
    return replace(recording, recovered=file.recovered)
