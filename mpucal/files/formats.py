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

from ..arguments import regular
from ..data import Recording
from ..errors import OutputError, RecordingError, UsageError
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE, SessionFile
from .budget import READ, afford
from .hints import NO_HINTS, Hints
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
    hinted : whether `load` and `rows` take Hints besides, and reads a file that is not recognised where some are given.
    only_recognised : whether a file that it does not recognise is no kind of recording, whatever its suffix.
    """

    suffix: str
    what: str
    load: str = ""
    rows: str = ""
    writer: str = ""
    recognises: str = ""
    session: SessionFile | None = None
    hinted: bool = False
    only_recognised: bool = False

    @property
    def is_read(self) -> bool:
        """Whether there is a reader of it."""
        return bool(self.load or self.rows)

    def is_of(self, path: Path) -> bool:
        """Whether what is at `path` is in this format, as far as that shows without reading it all."""
        suffix = FOLDER if path.is_dir() else path.suffix.lower()
        return suffix == self.suffix and (not self.recognises or bool(resolve_name(self.recognises)(path)))

    def read(self, *paths: Path, hints: Hints = NO_HINTS) -> Recording:
        """The recording, whole; see load."""
        for path in paths:
            afford(path, path.stat().st_size if path.is_file() else 0, READ)
        if not self.load:
            return self.read_rows(*paths).recording()
        recording: Recording = resolve_name(self.load)(*paths, *([hints] if self.hinted else []))
        return recording

    def read_rows(self, *paths: Path, hints: Hints = NO_HINTS) -> Rows:
        """The recording, a run of samples at a time; see open_rows."""
        if not self.rows:
            return Rows.of(self.read(*paths, hints=hints))
        rows: Rows = resolve_name(self.rows)(*paths, *([hints] if self.hinted else []))
        return rows

    def write(self, path: Path, rows: Rows, done: str) -> AbstractContextManager[Write]:
        """A new file of it; see open_writer."""
        context: AbstractContextManager[Write] = resolve_name(self.writer)(path, rows, done)
        return context


_HERE = "mpucal.files"
_TABLES = f"{_HERE}.tables"
_TABLE = "another program's table"
_BAG = (f"{_HERE}.ros:load_bag", f"{_HERE}.ros:bag_rows")
FORMATS = (
    Format(".mcap", "a bag of ROS 2", *_BAG, recognises=f"{_HERE}.ros:is_mcap_of_ros", hinted=True),
    Format(".mcap", "a capture", f"{_HERE}.capture:load_capture", f"{_HERE}.capture:capture_rows", session=CAPTURE),
    Format(".tlog", "a MAVLink log", f"{_HERE}.tlog:load_tlog", session=CAPTURE_OF_VEHICLE),
    Format(
        ".bin",
        "a dataflash log of ArduPilot",
        f"{_HERE}.dataflash:load_dataflash",
        recognises=f"{_HERE}.dataflash:is_dataflash",
    ),
    Format(".ulg", "a log of PX4", f"{_HERE}.ulog:load_ulog", hinted=True),
    Format(".db3", "a bag of ROS 2", *_BAG, hinted=True),
    Format(".bag", "a bag of ROS 1", *_BAG, hinted=True),
    *(
        Format(suffix, what, f"{_HERE}.arrays:load_arrays", recognises=recognises, hinted=True, only_recognised=True)
        for suffix, what, recognises in (
            (".npz", "another program's archive of NumPy", f"{_HERE}.arrays:is_of_others"),
            (".npy", "an array of NumPy", ""),
            (".mat", "a file of MATLAB", ""),
        )
    ),
    Format(".npz", "a NumPy archive", f"{_HERE}.npz:load_npz", f"{_HERE}.npz:npz_rows", f"{_HERE}.npz:npz_file"),
    Format(".parquet", "a Parquet file", f"{_HERE}.parquet:load_parquet", hinted=True),
    *(
        Format(
            suffix,
            what,
            f"{_HERE}.{load}",
            recognises=f"{_HERE}.{recognises}",
            hinted=True,
            only_recognised=what != _TABLE,
        )
        for suffix in (".csv", ".txt", ".log", ".tsv")
        for what, load, recognises in (
            ("MPU6050_raw's output", "serial_log:load_serial_log", "serial_log:is_serial_log"),
            (_TABLE, "tables.table:load_table", "tables.table:is_table"),
        )
    ),
    Format(".csv", "a table", rows=f"{_HERE}.csv:csv_rows", writer=f"{_HERE}.csv:csv_file"),
    Format(
        ".zip",
        "a phone's tables",
        f"{_TABLES}.phone:load_archive_of_tables",
        recognises=f"{_TABLES}.phone:is_archive_of_tables",
        hinted=True,
        only_recognised=True,
    ),
    Format(".mcap", "sensor_msgs/Imu for ROS 2 and Foxglove", writer=f"{_HERE}.imu:imu_file"),
    Format(FOLDER, "the folder of a bag", *_BAG, recognises=f"{_HERE}.ros:is_folder_of_ros", hinted=True),
    Format(
        FOLDER,
        "the folder of a phone's tables",
        f"{_TABLES}.phone:load_folder_of_tables",
        recognises=f"{_TABLES}.phone:is_folder_of_tables",
        hinted=True,
    ),
    Format(
        FOLDER,
        "a folder of recordings of one sensor",
        f"{_HERE}.several:load_folder_of_recordings",
        recognises=f"{_HERE}.several:is_folder_of_recordings",
        hinted=True,
    ),
    Format(FOLDER, "the folder of a session", f"{_HERE}.folder:load_folder", f"{_HERE}.folder:folder_rows"),
)


def recognised(path: Path) -> Format | None:
    """The format of a recording; None of what is none.

    Raises
    ------
    RecordingError : it is a pipe or device, whose bytes can be read once at best.
    """
    regular(path)
    return next((row for row in FORMATS if row.is_read and row.is_of(path)), None)


def format_of(path: Path, hints: Hints = NO_HINTS) -> Format:
    """The format to read `path` by.

    Raises
    ------
    RecordingError : there is no such file, or no reader of its suffix. UsageError : its reader takes no hints.
    """
    if not path.exists():
        raise RecordingError(f"there is no file {path}", "check the path")
    suffix = FOLDER if path.is_dir() else path.suffix.lower()
    of_suffix = [row for row in FORMATS if row.is_read and row.suffix == suffix]
    found = recognised(path)
    if hints.given and not (found and found.hinted):
        found = next((row for row in reversed(of_suffix) if row.hinted), found)
        if found is None or not found.hinted:
            what = found.what if found else "no kind of recording that mpucal knows"
            raise UsageError(
                f"{path} is {what}, of which nothing has to be said",
                "leave out --topic, --columns, --units, --accel-range, --gyro-range and --rate",
            )
    others = [row for row in of_suffix if not row.only_recognised]
    if found is None and not others:
        raise RecordingError(f"{path} is no kind of recording that mpucal knows", f"give {_suffixes()}")
    return found or others[-1]


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
    return _listed(row for row in FORMATS if row.is_read and (row.hinted or not row.rows))


def writable() -> str:
    """All that is written, in words."""
    return _listed(row for row in FORMATS if row.writer)


def _listed(rows: Iterable[Format]) -> str:
    suffixes: dict[str, list[str]] = {}
    for row in rows:
        suffixes.setdefault(row.what, []).extend([row.suffix] if row.suffix != FOLDER else [])
    *others, last = (f"{what} ({', '.join(of)})" if of else what for what, of in suffixes.items())
    return f"{', '.join(others)} or {last}"


def _suffixes() -> str:
    read = [row for row in FORMATS if row.is_read and not row.hinted]
    own = ", ".join(dict.fromkeys(row.suffix for row in read if row.suffix != FOLDER))
    folders = " or ".join(row.what for row in read if row.suffix == FOLDER)
    others = dict.fromkeys(row.suffix for row in FORMATS if row.hinted and row.suffix not in (FOLDER, *own.split(", ")))
    return f"a {own} file or {folders}, or of another program a {', '.join(others)} file or a folder"
