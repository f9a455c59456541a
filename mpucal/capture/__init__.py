"""Recording files: captures, NumPy archives and tables, each read by its own module. Knows no estimate."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from ..data import Recording
from ..errors import RecordingError

# ending -> (module, function): a reader's library is loaded only when its file is
_READERS = {
    ".mcap": (".decoded", "load_capture"),
    ".npz": (".npz", "load_npz"),
    ".csv": (".csv", "load_csv"),
}
_KNOWN = f"give a {', '.join(_READERS)} or the folder of a session"


def load(path: str | Path) -> Recording:
    """The recording in a file (.mcap, .npz, .csv), or in the capture of a session's folder.

    Raises
    ------
    RecordingError : no such file, one of another kind, or no recording in it.
    CaptureError : a capture that cannot be read.
    """
    path = Path(path)
    if path.is_dir():
        path = _capture_in(path)
    if path.suffix.lower() not in _READERS:
        raise RecordingError(f"{path} is no kind of recording that mpucal knows", _KNOWN)
    if not path.exists():
        raise RecordingError(f"there is no file {path}", "check the path")
    module, function = _READERS[path.suffix.lower()]
    read: Callable[[Path], Recording] = getattr(import_module(module, __name__), function)
    return read(path)


def _capture_in(folder: Path) -> Path:
    path = folder / "capture.mcap"
    if not path.exists():
        raise RecordingError(f"the folder {folder} holds no {path.name}", _KNOWN)
    return path
