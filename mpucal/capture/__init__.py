"""Recording files: captures, NumPy archives and tables, each read by its own module. Knows no estimate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..data import Recording
from ..errors import RecordingError

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
    if path.is_dir():
        path = _capture_in(path)
    if not path.exists():
        raise RecordingError(f"there is no file {path}", "check the path")
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise RecordingError(f"{path} is no kind of recording that mpucal knows", _REMEDY)
    # a kind's library is loaded only when a file of that kind is
    if kind == ".mcap":
        return _load_capture(path)
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


def _load_capture(path: Path) -> Recording:
    from ..bus.records import SessionEvent  # noqa: PLC0415
    from ..chip.decode import decode  # noqa: PLC0415
    from .mcap import read_capture  # noqa: PLC0415

    capture = read_capture(path)
    accesses = [record for record in capture.records if not isinstance(record, SessionEvent)]
    return replace(decode(accesses, capture.name), recovered=capture.recovered)


def _capture_in(folder: Path) -> Path:
    for path in (folder / "capture.mcap", folder / "capture.tlog"):
        if path.exists():
            return path
    raise RecordingError(f"the folder {folder} holds no capture.mcap and no capture.tlog", _REMEDY)
