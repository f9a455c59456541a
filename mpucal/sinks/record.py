"""Records of a write to a sink in the result files, so that a bias is not removed from a sample twice."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..arguments import read_limited
from ..data import Recording
from ..errors import RecordingError
from ..result.calibration import Calibration
from ..result.keys import FORMAT
from ..result.session_files import DOCUMENT
from ..session.results import result_files, save
from ..strict_json import MOST_BYTES, parse_json
from .kind import Effect, SinkKind

# key in calibration.json: the writes, one entry each
WRITTEN = "written"

# saves the calibration that applies after a write to a sink; returns the content of calibration.json
Recorder = Callable[[SinkKind, Calibration], Calibration]


def session_recorder(
    folder: Path, measured: Calibration, recording: Recording, truth: Mapping[str, Any] | None
) -> Recorder:
    """Return the recorder for a session's folder, by the sink's effect; `measured` is the session's result."""

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


def file_recorder(path: Path) -> Recorder:
    """Return the recorder for the file `path` (.json) and a config blob (.bin) beside it."""

    def record(_kind: SinkKind, now: Calibration) -> Calibration:
        save(path.parent, {path.with_suffix(".bin").name: now.blob().encode(), path.name: now.json().encode()})
        return now

    return record


def is_calibration(path: Path) -> bool:
    """Return False if the file is a saved state of a sink; True for a calibration, even if damaged or missing."""
    if path.suffix != ".json":
        return path.suffix == ".bin" or not path.exists()
    try:
        return bool(parse_json(read_limited(path, MOST_BYTES)).get("format") == FORMAT)
    except (RecordingError, ValueError, AttributeError):
        return True
