"""The formats of recording files, a row each; what reads or writes one is imported when such a file is met.

Several rows may share a suffix: the first that recognises a file reads it, and the last of them takes what none
recognises, to say what is wrong with it.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name

from ..data import Recording
from ..errors import OutputError, RecordingError
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE, SessionFile
from .rows import Rows, Write

FOLDER = "/"


@dataclass(frozen=True)
class Format:
    """A format of recording files; its functions are named "module:attribute", and empty where there is none.

    Attributes
    ----------
    suffix : that its files' names end with, in lower case; FOLDER of a folder.
    what : what a file of it holds, in words with an article.
    load : (path) -> Recording, the whole file. rows : (path) -> Rows, in bounded memory. One of them is enough.
    writer : (path, rows, done) -> context of a Write; see open_writer.
    recognises : (path) -> bool, whether a file of this suffix is one. Empty: each is.
    session : the file in which a session is captured in it; `load` and `rows` then take every part of a resumed one.
    """

    suffix: str
    what: str
    load: str = ""
    rows: str = ""
    writer: str = ""
    recognises: str = ""
    session: SessionFile | None = None

    @property
    def is_read(self) -> bool:
        """Whether there is a reader of it."""
        return bool(self.load or self.rows)

    def is_of(self, path: Path) -> bool:
        """Whether what is at `path` is in this format, as far as that shows without reading it all."""
        suffix = FOLDER if path.is_dir() else path.suffix.lower()
        return suffix == self.suffix and (not self.recognises or bool(resolve_name(self.recognises)(path)))

    def read(self, *paths: Path) -> Recording:
        """The recording, whole; see load."""
        if not self.load:
            return self.read_rows(*paths).recording()
        recording: Recording = resolve_name(self.load)(*paths)
        return recording

    def read_rows(self, *paths: Path) -> Rows:
        """The recording, a run of samples at a time; see open_rows."""
        if not self.rows:
            return Rows.of(self.read(*paths))
        rows: Rows = resolve_name(self.rows)(*paths)
        return rows

    def write(self, path: Path, rows: Rows, done: str) -> AbstractContextManager[Write]:
        """A new file of it; see open_writer."""
        context: AbstractContextManager[Write] = resolve_name(self.writer)(path, rows, done)
        return context


_HERE = "mpucal.files"
FORMATS = (
    Format(".mcap", "a capture", f"{_HERE}.capture:load_capture", f"{_HERE}.capture:capture_rows", session=CAPTURE),
    Format(".tlog", "a MAVLink log", f"{_HERE}.tlog:load_tlog", session=CAPTURE_OF_VEHICLE),
    Format(
        ".bin",
        "a dataflash log of ArduPilot",
        f"{_HERE}.dataflash:load_dataflash",
        recognises=f"{_HERE}.dataflash:is_dataflash",
    ),
    Format(".npz", "a NumPy archive", f"{_HERE}.npz:load_npz", f"{_HERE}.npz:npz_rows", f"{_HERE}.npz:npz_file"),
    Format(".csv", "a table", rows=f"{_HERE}.csv:csv_rows", writer=f"{_HERE}.csv:csv_file"),
    Format(".mcap", "sensor_msgs/Imu for ROS 2 and Foxglove", writer=f"{_HERE}.imu:imu_file"),
    Format(FOLDER, "the folder of a session", f"{_HERE}.folder:load_folder", f"{_HERE}.folder:folder_rows"),
)


def recognised(path: Path) -> Format | None:
    """The format of a recording; None of what is none."""
    return next((row for row in FORMATS if row.is_read and row.is_of(path)), None)


def format_of(path: Path) -> Format:
    """The format to read `path` by.

    Raises
    ------
    RecordingError : there is no such file, or no reader of its suffix.
    """
    if not path.exists():
        raise RecordingError(f"there is no file {path}", "check the path")
    suffix = FOLDER if path.is_dir() else path.suffix.lower()
    of_suffix = [row for row in FORMATS if row.is_read and row.suffix == suffix]
    if not of_suffix:
        raise RecordingError(f"{path} is no kind of recording that mpucal knows", f"give {_suffixes()}")
    return recognised(path) or of_suffix[-1]


def written_format(path: Path) -> Format:
    """The format to write `path` in.

    Raises
    ------
    OutputError : there is no writer of its suffix.
    """
    written = {row.suffix: row for row in FORMATS if row.writer}
    if path.suffix.lower() not in written:
        raise OutputError(f"{path} ends with no kind of file that is written", f"end it with {', '.join(written)}")
    return written[path.suffix.lower()]


def is_of_session(name: str) -> bool:
    """Whether a file of this name is in a format that sessions are captured in."""
    return any(row.session and row.suffix == Path(name).suffix.lower() for row in FORMATS)


def readable() -> str:
    """All that is read, in words."""
    return _listed(row for row in FORMATS if row.is_read)


def held_whole() -> str:
    """All of which the samples have to fit the memory, in words."""
    return _listed(row for row in FORMATS if row.is_read and not row.rows)


def writable() -> str:
    """All that is written, in words."""
    return _listed(row for row in FORMATS if row.writer)


def _listed(rows: Iterable[Format]) -> str:
    *others, last = (row.what if row.suffix == FOLDER else f"{row.what} ({row.suffix})" for row in rows)
    return f"{', '.join(others)} or {last}"


def _suffixes() -> str:
    read = [row for row in FORMATS if row.is_read]
    suffixes = ", ".join(dict.fromkeys(row.suffix for row in read if row.suffix != FOLDER))
    return " or ".join([f"a {suffixes} file", *(row.what for row in read if row.suffix == FOLDER)])
