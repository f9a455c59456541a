"""Recording files: captures, NumPy archives and tables, each read by its own module. Knows no estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..data import Recording
from ..errors import RecordingError
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE
from .parts import captures_in

KINDS = (".mcap", ".tlog", ".bin", ".npz", ".csv")
_REMEDY = f"give a {', '.join(KINDS)} file or the folder of a session"


def load(path: str | Path) -> Recording:
    """The recording in a file (.mcap, .tlog, .bin of ArduPilot, .npz, .csv), or in the capture of a session's folder.

    A capture that was cut short gives what is whole of it, and says so in `recovered`.

    Raises
    ------
    RecordingError : no such file, one of another kind, or no recording in it.
    CaptureError : a capture that cannot be read.
    ChipError : the capture of a chip that is not known.
    """
    path = Path(path)
    parts = [path]
    if path.is_dir():
        parts = captures_of(path)
        path = parts[0]
    if not path.exists():
        raise RecordingError(f"there is no file {path}", "check the path")
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise RecordingError(f"{path} is no kind of recording that mpucal knows", _REMEDY)
    # a kind's library is loaded only when a file of that kind is
    if kind == ".mcap":
        return _load_captures(parts)
    if kind == ".tlog":
        from .tlog import load_tlog  # noqa: PLC0415

        return load_tlog(path)
    if kind == ".bin":
        from .dataflash import load_dataflash  # noqa: PLC0415

        return load_dataflash(path)
    if kind == ".npz":
        from .npz import load_npz  # noqa: PLC0415

        return load_npz(path)
    from .csv import load_csv  # noqa: PLC0415

    return load_csv(path)


def _load_captures(paths: Sequence[Path]) -> Recording:
    """The recording in the captures of one session, without what its person wanted to forget."""
    from ..chip.decode import decode  # noqa: PLC0415
    from ..chip.records import FORGET, SessionEvent  # noqa: PLC0415
    from .mcap import read_capture  # noqa: PLC0415

    captures = [read_capture(path) for path in paths]
    records = [record for capture in captures for record in capture.records]
    accesses = [record for record in records if not isinstance(record, SessionEvent)]
    recording = decode(accesses, captures[0].name)
    forgotten = {
        int(record.data["first"]): int(record.data["last"])
        for record in records
        if isinstance(record, SessionEvent) and record.name == FORGET
    }
    for first, last in sorted(forgotten.items(), reverse=True):
        recording = recording.without(first, last)
    recovered = [capture.recovered for capture in captures if capture.recovered is not None]
    return replace(recording, recovered=recovered[-1] if recovered else None)


def captures_of(folder: Path) -> list[Path]:
    """The captures in the folder of a session; RecordingError where there is none."""
    found = captures_in(folder)
    if found:
        return found
    of_vehicle = folder / CAPTURE_OF_VEHICLE.name
    if of_vehicle.exists():
        return [of_vehicle]
    raise RecordingError(f"the folder {folder} holds no {CAPTURE.name} and no {CAPTURE_OF_VEHICLE.name}", _REMEDY)
