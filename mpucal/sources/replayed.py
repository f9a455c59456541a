"""Captures as sources: replayed, or followed by the sensor itself in a session that is resumed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from ..errors import UsageError
from ..files.mcap import Capture, read_capture
from ..files.recorders import VEHICLE, recorder_of
from ..mavlink.tlog import TLOG
from ..result.session_files import CAPTURE, captures_in
from ..session.plan import Plan
from .kind import Request
from .opened_source import SOURCE, OpenedSource
from .opening import refuse_fixed_options, reopen_source
from .recorded_parts import RecordedParts, split_at_resumes
from .replay import PacketReplay, ReplayBus


def open_source(request: Request) -> OpenedSource:
    """Open a capture, or all captures in the folder of a session.

    Raises
    ------
    UsageError : options that the capture fixes. CaptureError : not a capture, or one of another driver.
    RecordingError : a log without an IMU.
    """
    if request.value.suffix.lower() != TLOG:
        refuse_fixed_options(request)
    captures = _read(request.value)
    first = captures[0]
    how: dict[str, Any] = {"recovered": _last_recovered(captures), "real_time": False}
    # The log of another ground station has no head, and fixes no options.
    plan, recorder = replace(request.plan, until_end=True), VEHICLE
    if first.meta:
        refuse_fixed_options(request)
        plan, recorder = Plan.of_capture(first.meta, first.name), recorder_of(first.meta, first.name)
        plan = replace(plan, board=request.plan.board or plan.board)
    kind: type[OpenedSource] = resolve_name(recorder.opened)
    return kind.replayed(first, _parts(captures), plan, request.values, **how)


def open_resumed(folder: Path) -> OpenedSource:
    """Open the session in `folder` and the source that its first capture names, which goes on after the replay.

    Raises
    ------
    UsageError : no session, or its source cannot be opened again. CaptureError : a damaged head.
    """
    if not captures_in(folder):
        raise UsageError(f"{folder} does not hold a session", "give the folder of an interrupted session")
    captures = _read(folder)
    words = captures[0].meta.get(SOURCE)
    if not words:
        raise UsageError(f"the capture in {folder} does not name its source", "use `mpucal calibrate` on the folder")
    plan = Plan.of_capture(captures[0].meta, captures[0].name)
    live = reopen_source(words, plan)
    return replace(
        live,
        line=_parts(captures, live.line),
        plan=plan,
        recovered=_last_recovered(captures),
        capture_name=CAPTURE.numbered(len(captures) + 1),
    )


def _read(place: Path) -> list[Capture]:
    """Read a capture, or all captures in the folder of a session.

    Raises
    ------
    CaptureError : not a capture.
    """
    return [_read_file(file) for file in captures_in(place) or [place]]


def _read_file(file: Path) -> Capture:
    if file.suffix.lower() != TLOG:
        return read_capture(file)
    from ..files.vehicle_logs import read_tlog  # noqa: PLC0415 - it decodes MAVLink, which a chip's capture does without

    return read_tlog(file)


def _last_recovered(captures: Sequence[Capture]) -> str | None:
    """Return the sentence on the last damaged capture, None if all are whole."""
    return next((capture.recovered for capture in reversed(captures) if capture.recovered), None)


def _parts(captures: Sequence[Capture], live: Any = None) -> RecordedParts[Any]:
    """Return the recorded parts of a session, followed by its `live` bus or transport, as one."""
    first, *later = split_at_resumes((capture.records for capture in captures), more=live is not None)
    name = captures[0].name
    of_vehicle = not captures[0].meta or recorder_of(captures[0].meta, name) is VEHICLE
    return (PacketReplay if of_vehicle else ReplayBus)(first, name, later, live)
