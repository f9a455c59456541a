"""Logs of vehicles as recordings: .tlog, also as a capture, and ArduPilot's dataflash logs (.bin), by pymavlink."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

from ..arguments import LARGEST
from ..data import Recording
from ..errors import RecordingError
from ..mavlink.dialect import import_pymavlink
from ..mavlink.firmwares import ARDUPILOT
from ..mavlink.imu import DATAFLASH, Reading, Stream
from ..mavlink.log import Log, read_log
from ..mavlink.tlog import RawPacket, TlogFile, encode_tlog
from ..result.session_files import CAPTURE
from .mcap import Capture, CaptureReader
from .reading import check_size, first_bytes

MAGIC = b"\xa3\x95"
PARAMETER = "PARM"
# before ArduPilot 4.0 each IMU had its own message; since then `I` numbers them from 0
IMUS = ("IMU", "IMU2", "IMU3")


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


def is_dataflash(path: Path) -> bool:
    """Return True if a file begins as a dataflash log."""
    return first_bytes(path, len(MAGIC)) == MAGIC


def load_dataflash(path: Path) -> Recording:
    """Return the recording of the vehicle's first IMU in a dataflash log, with the other IMUs in its `others`.

    Raises
    ------
    RecordingError : it holds no IMU messages.
    """
    log = Log(ARDUPILOT)
    # the reader prints its complaints
    with redirect_stderr(StringIO()), redirect_stdout(StringIO()):
        _fill(log, path)
    if not any(map(len, log.segments)):
        raise RecordingError(
            f"{path} holds no IMU messages",
            "have LOG_BITMASK log the IMU (IMU or IMU_FAST) also while disarmed, and turn it again",
        )
    return log.recording(path.name)


def _fill(log: Log, path: Path) -> None:
    """Add the IMU and parameter messages to the log, up to the first damage of the file."""
    # pymavlink raises bare Exceptions, too
    with suppress(Exception), _reader(path) as reader:
        while (message := reader.recv_match(type=[PARAMETER, *IMUS])) is not None:
            if message.get_type() == PARAMETER:
                log.add_parameter(str(message.Name), float(message.Value))
                continue
            content = _reading(message)
            if content is not None:
                log.add_reading(content, content.time * 1000)


@contextmanager
def _reader(path: Path) -> Iterator[Any]:
    """Open pymavlink's reader, and close its file even if its constructor fails."""
    # its compiled indexer is hardly faster, and prints past redirect_stderr
    os.environ.setdefault("PYMAVLINK_FAST_INDEX", "0")
    kind = import_pymavlink("DFReader").DFReader_binary
    reader = kind.__new__(kind)
    try:
        reader.__init__(str(path))
        yield reader
    finally:
        for held in ("filehandle", "data_map"):
            if hasattr(reader, held):
                getattr(reader, held).close()


def _reading(message: Any) -> Reading | None:
    imu = getattr(message, "I", IMUS.index(message.get_type())) + 1
    acc, gyr = (message.AccX, message.AccY, message.AccZ), (message.GyrX, message.GyrY, message.GyrZ)
    if not all(abs(v) <= LARGEST for v in acc + gyr):
        return None
    warmth = getattr(message, "T", math.nan)
    return Reading(Stream(DATAFLASH, imu), int(message.TimeUS), acc, gyr, float(warmth))
