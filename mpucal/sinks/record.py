"""What the files say after a write to a sink: what is applied where, so that nothing is removed from a sample twice."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..arguments import content
from ..data import Recording
from ..errors import RecordingError
from ..result.calibration import Calibration
from ..result.document import FORMAT
from ..result.session_files import DOCUMENT
from ..session.results import result_files, save
from ..strict_json import MOST_BYTES, parsed
from .kind import Effect, SinkKind

# of calibration.json: the writes, one entry each
WRITTEN = "written"

# saves the calibration of the sensor as it is after a write to a sink; gives what calibration.json then holds
Record = Callable[[SinkKind, Calibration], Calibration]


def in_session(folder: Path, measured: Calibration, recording: Recording, truth: Mapping[str, Any] | None) -> Record:
    """Records in a session's folder, as the sink's effect demands; `measured` is what the session found."""

    def record(kind: SinkKind, now: Calibration) -> Calibration:
        if kind.effect is Effect.LESS_BIAS:
            save(folder, dict(result_files(now, recording, truth)))
            return now
        held = now
        files = {}
        if kind.effect is Effect.OTHER_STREAM:
            files[kind.after_write(Path(DOCUMENT.name).stem)] = now.json().encode()
            held = replace(measured, extra={**measured.extra, WRITTEN: now.extra[WRITTEN]})
        save(folder, {**files, DOCUMENT.name: held.json().encode()})
        return held

    return record


def in_file(path: Path) -> Record:
    """Records in a file of its own, `path` (.json), and the same as a config blob (.bin)."""

    def record(_kind: SinkKind, now: Calibration) -> Calibration:
        save(path.parent, {path.with_suffix(".bin").name: now.blob().encode(), path.name: now.json().encode()})
        return now

    return record


def is_calibration(path: Path) -> bool:
    """Whether it is one (or damaged, or not there), and not a file of another kind in which a sink keeps its state."""
    if path.suffix != ".json":
        return path.suffix == ".bin" or not path.exists()
    try:
        return bool(parsed(content(path, MOST_BYTES)).get("format") == FORMAT)
    except (RecordingError, ValueError, AttributeError):
        return True
