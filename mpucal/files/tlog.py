"""MAVLink .tlog files as recordings, and as captures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..data import Recording
from ..errors import RecordingError
from ..mavlink.log import read_log
from ..mavlink.tlog import RawPacket, TlogFile, encode_tlog
from ..result.session_files import CAPTURE
from .mcap import Capture, CaptureReader
from .reading import check_size


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


def read_tlog(path: Path) -> Capture:
    """Return the packets of a .tlog as a capture without a head.

    Raises
    ------
    CaptureError : it cannot be read, or holds no packet.
    """
    file = TlogFile(path)
    return Capture({}, tuple(file), file.recovered, file.name)


def tlog_of(place: Path) -> bytes:
    """Return the packets in a vehicle's capture, or in the captures of its session's folder, as a .tlog.

    Raises
    ------
    CaptureError : not a capture. RecordingError : it holds no packets.
    """
    packets = [
        record
        for path in CAPTURE.all_in(place) or [place]
        for record in CaptureReader(path)
        if isinstance(record, RawPacket)
    ]
    if not packets:
        raise RecordingError(f"{place} holds no packets of a vehicle", "give the capture of a session with --mavlink")
    return encode_tlog(packets)
