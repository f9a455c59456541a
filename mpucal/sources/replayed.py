"""Replay of a capture as a source: the accesses of a bus (.mcap) or the packets of a vehicle (.tlog)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..files.folder import captures_in
from ..files.mcap import read_capture
from ..iio import IIO_VERSION
from ..session.plan import DRIVER, Plan
from .chained_bus import ChainedBus, split_at_resumes
from .chip import OpenedChip
from .iio import iio_replay
from .kind import Request
from .opened_source import OpenedSource
from .opening import refuse_fixed_options
from .replay import ReplayBus

TLOG = ".tlog"


def open_source(request: Request) -> OpenedSource:
    """Open a capture, or all captures in the folder of a resumed session.

    Raises
    ------
    UsageError : options that the capture fixes. CaptureError : not a capture, or one of another driver.
    RecordingError : a .tlog without an IMU.
    """
    file: Path = request.value
    if file.suffix.lower() != TLOG:
        refuse_fixed_options(request)
        return _open_mcap(file, request.plan.board)
    # pymavlink loads slowly, and a chip on a bus does not need it.
    from .vehicle import OpenedVehicle, open_tlog  # noqa: PLC0415

    source = open_tlog(file, replace(request.plan, until_end=True), request.values.get("system"))
    if isinstance(source, OpenedVehicle):
        # A .tlog of another ground station fixes no options.
        refuse_fixed_options(request)
    return source


def _open_mcap(file: Path, board: str) -> OpenedChip:
    captures = [read_capture(path) for path in (captures_in(file) or [file])]
    name = captures[0].name
    bus = ChainedBus([ReplayBus(part, name) for part in split_at_resumes(capture.records for capture in captures)])
    recovered = [capture.recovered for capture in captures if capture.recovered]
    plan = Plan.of_capture(captures[0].meta, name)
    plan = replace(plan, board=board or plan.board)
    opened = OpenedChip(bus, plan, replay=bus, recovered=recovered[-1] if recovered else None, real_time=False)
    return iio_replay(opened, captures[0]) if captures[0].meta[DRIVER] == IIO_VERSION else opened
