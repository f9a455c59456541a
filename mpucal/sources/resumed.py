"""Session that is resumed after an interruption: its captures are replayed, then the sensor is measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..errors import UsageError
from ..files.folder import all_captures_in
from ..result.session_files import CAPTURE
from ..session.plan import Plan
from .opened_source import SOURCE, OpenedSource
from .opening import reopen_source
from .replayed import chained, last_recovered, read_captures


def open_resumed(folder: Path) -> OpenedSource:
    """Open the session in `folder` and the source that its first capture names.

    Raises
    ------
    UsageError : no session, or its source cannot be opened again. CaptureError : a damaged head.
    """
    if not all_captures_in(folder):
        raise UsageError(f"{folder} does not hold a session", "give the folder of an interrupted session")
    captures = read_captures(folder)
    words = captures[0].meta.get(SOURCE)
    if not words:
        raise UsageError(f"the capture in {folder} does not name its source", "use `mpucal calibrate` on the folder")
    plan = Plan.of_capture(captures[0].meta, captures[0].name)
    live = reopen_source(words, plan)
    return replace(
        live,
        line=chained(captures, live.line),
        plan=plan,
        recovered=last_recovered(captures),
        capture_name=CAPTURE.numbered(len(captures) + 1),
    )
