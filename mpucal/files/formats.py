"""The formats of recording files, a row each; a format's module is imported when such a file is read or written.

Several rows may share a suffix: the first that recognises a file reads it, and the last reads a file that none
recognises, so that its error message says what is wrong.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name

from ..arguments import check_regular
from ..data import Recording
from ..errors import OutputError, RecordingError, UsageError
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE, SessionFile
from .hints import NO_HINTS, Hints
from .reading import FILE_PER_MEMORY, check_size, first_bytes, is_text
from .rows import Rows, Write

FOLDER, ANY_TEXT = "/", ".txt"


@dataclass(frozen=True)
class Format:
    """A format of recording files; its functions are named "package.module:function", or empty if there is none.

    Attributes
    ----------
    suffix : of its files' names, in lower case; FOLDER for a folder.
    what : the content of such a file, in words with an article.
    load : (path) -> Recording, the whole file. rows : (path) -> Rows, in bounded memory. One of them is enough.
    writer : (path, rows, done) -> context of a Write; see open_writer.
    recognises : (path) -> bool, True if a file of this suffix is of this format. Empty: every such file is.
    session : the capture file of sessions in this format; `load` and `rows` then take all parts of a resumed session.
    hinted : `load` and `rows` also take Hints; with hints, this format reads files that it does not recognise.
    only_recognised : a file that is not recognised is not a recording.
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
        """Return True if files of this format can be read."""
        return bool(self.load or self.rows)

    def matches(self, path: Path) -> bool:
        """Return True if the file or folder looks like this format; it is not read to its end."""
        return _suffix(path) == self.suffix and (not self.recognises or bool(resolve_name(self.recognises)(path)))

    def read(self, *paths: Path, hints: Hints = NO_HINTS) -> Recording:
        """Return the whole recording; see load."""
        for path in paths:
            check_size(path, path.stat().st_size if path.is_file() else 0, FILE_PER_MEMORY)
        if not self.load:
            return self.read_rows(*paths).recording()
        recording: Recording = resolve_name(self.load)(*paths, *([hints] if self.hinted else []))
        return recording

    def read_rows(self, *paths: Path, hints: Hints = NO_HINTS) -> Rows:
        """Return the recording a run of samples at a time; see open_rows."""
        if not self.rows:
            return Rows.of(self.read(*paths, hints=hints))
        rows: Rows = resolve_name(self.rows)(*paths, *([hints] if self.hinted else []))
        return rows

    def write(self, path: Path, rows: Rows, done: str) -> AbstractContextManager[Write]:
        """Open a new file of this format; see open_writer."""
        context: AbstractContextManager[Write] = resolve_name(self.writer)(path, rows, done)
        return context


_HERE = "mpucal.files"
PACKED = ".zip", ".gz"


def _others(
    suffixes: str, what: str, load: str, recognises: str = "", rows: str = "", *, only: bool = True
) -> Iterator[Format]:
    """Yield the rows of a format of other programs, which takes hints; `only`: see Format.only_recognised."""
    load, rows, recognises = (name and f"{_HERE}.{name}" for name in (load, rows, recognises))
    for suffix in suffixes.split():
        yield Format(suffix, what, load, rows, recognises=recognises, hinted=True, only_recognised=only)


_TEXTS = ".csv .txt .log .tsv"
_TABLE = ("another program's table", "tables.load:load_table", "tables.load:is_table")
_TWO = ("a phone's tables", "tables.phone:load_two_tables", "tables.phone:is_one_of_two_tables")
_PHONE = ("the folder of a phone's tables", "tables.phone:load_folder_of_tables", "tables.phone:is_folder_of_tables")
_FOLDER = "folder:load_folder_of_recordings", "folder:is_folder_of_recordings"
_BAG, _BAG_ROWS = "ros:load_bag", "ros:bag_rows"
_ARRAYS = "arrays:load_arrays"
FORMATS = (
    *_others(".mcap", "a bag of ROS 2", _BAG, "mcap:is_mcap_of_ros", _BAG_ROWS, only=False),
    Format(".mcap", "a capture", f"{_HERE}.capture:load_capture", f"{_HERE}.capture:capture_rows", session=CAPTURE),
    Format(".tlog", "a MAVLink log", f"{_HERE}.tlog:load_tlog", session=CAPTURE_OF_VEHICLE),
    Format(
        ".bin",
        "a dataflash log of ArduPilot",
        f"{_HERE}.dataflash:load_dataflash",
        recognises=f"{_HERE}.dataflash:is_dataflash",
        only_recognised=True,
    ),
    # any other .bin that is given is read as such, but none in a folder
    *_others(".bin", "records of numbers", "records:load_records", "dataflash:is_dataflash", only=False),
    *_others(".ulg", "a log of PX4", "ulog:load_ulog", only=False),
    *_others(".db3", "a bag of ROS 2", _BAG, rows=_BAG_ROWS, only=False),
    *_others(".bag", "a bag of ROS 1", _BAG, rows=_BAG_ROWS, only=False),
    *_others(f"{_TEXTS} .mat .npy .json .parquet", *_TWO),
    *_others(".npz", "another program's archive of NumPy", _ARRAYS, "arrays:is_of_others"),
    *_others(".npy", "an array of NumPy", _ARRAYS),
    *_others(".mat", "a file of MATLAB", _ARRAYS),
    *_others(".h5 .hdf5 .hdf", "a file of HDF5", _ARRAYS),
    *_others(".json .jsonl .ndjson", "samples in JSON", _ARRAYS, "arrays:is_json_of_samples"),
    Format(".npz", "a NumPy archive", rows=f"{_HERE}.npz:npz_rows", writer=f"{_HERE}.npz:npz_file"),
    *_others(".parquet .feather", "a file of Arrow", _ARRAYS, only=False),
    *_others(".xlsx", "a workbook", "workbook:load_workbook", only=False),
    Format(
        ".csv",
        "a table",
        rows=f"{_HERE}.csv:csv_rows",
        writer=f"{_HERE}.csv:csv_file",
        recognises=f"{_HERE}.tables.load:is_own_table",
        only_recognised=True,
    ),
    *_others(_TEXTS, *_TABLE, only=False),
    *_others(" ".join(PACKED), "an archive of recordings", "archive:load_archive", "archive:is_archive"),
    Format(".mcap", "sensor_msgs/Imu for ROS 2 and Foxglove", writer=f"{_HERE}.imu:imu_file"),
    *_others(FOLDER, "the folder of a bag", _BAG, "ros:is_folder_of_ros", _BAG_ROWS, only=False),
    *_others(FOLDER, *_PHONE, only=False),
    *_others(FOLDER, "a folder of recordings of one sensor", *_FOLDER, only=False),
    Format(FOLDER, "the folder of a session", f"{_HERE}.folder:load_folder", f"{_HERE}.folder:folder_rows"),
)


def recognise(path: Path) -> Format | None:
    """Return the format of a recording; None if the file is not a recording.

    Raises
    ------
    RecordingError : it is a pipe or device, whose bytes can be read once at best.
    """
    check_regular(path)
    return next((row for row in FORMATS if row.is_read and row.matches(path)), None)


def find_format(path: Path, hints: Hints = NO_HINTS) -> Format:
    """Return the format to read `path` with.

    Raises
    ------
    RecordingError : there is no such file, or no reader for its suffix. UsageError : its reader takes no hints.
    """
    if not path.exists():
        raise RecordingError(f"there is no file {path}", "check the path")
    of_suffix = [row for row in FORMATS if row.is_read and row.suffix == _suffix(path)]
    found = recognise(path)
    if hints.given and not (found and found.hinted):
        # A recording of mpucal is not read as another program's file.
        if not (found and (found.session or found.suffix == FOLDER)):
            found = next((row for row in reversed(of_suffix) if row.hinted), found)
        if found is None or not found.hinted:
            what = found.what if found else "not a recording that mpucal knows"
            raise UsageError(
                f"{path} is {what}; it needs no options on how to read it",
                "leave out --topic, --sensor, --columns, --units, --accel-range, --gyro-range and --rate",
            )
    others = [row for row in of_suffix if not row.only_recognised and row.suffix in (FOLDER, path.suffix.lower())]
    if found is None and not others:
        if of_suffix and path.is_file() and path.stat().st_size == 0:
            raise RecordingError(f"{path} is empty", "record it again")
        shows = f"give a recording; `{shlex.join(['mpucal', 'show', str(path)])}` shows a calibration"
        holds_none = of_suffix and path.suffix.lower() not in PACKED
        remedy = shows if holds_none else f"export a table as .csv, or give {_suffixes()}"
        raise RecordingError(f"{path} is not a recording that mpucal knows", remedy)
    return found or others[-1]


def _suffix(path: Path) -> str:
    """Return the suffix of a file's format: that of a table for text of any other suffix, such as .dat or .lvm."""
    if path.is_dir():
        return FOLDER
    suffix = path.suffix.lower()
    return suffix if is_suffix(suffix) or not is_text(first_bytes(path)) else ANY_TEXT


def written_format(path: Path) -> Format:
    """Return the format to write `path` in.

    Raises
    ------
    OutputError : there is no writer for its suffix.
    """
    written = {row.suffix: row for row in FORMATS if row.writer}
    if path.suffix.lower() not in written:
        raise OutputError(f"mpucal cannot write a file like {path}", f"end its name with {', '.join(written)}")
    return written[path.suffix.lower()]


def is_suffix(suffix: str) -> bool:
    """Return True if a format that can be read has this suffix."""
    return any(row.is_read and row.suffix == suffix.lower() for row in FORMATS)


def readable_formats() -> str:
    """Return the formats that can be read, as text."""
    return _list_formats(row for row in FORMATS if row.is_read)


def writable_formats() -> str:
    """Return the formats that can be written, as text."""
    return _list_formats(row for row in FORMATS if row.writer)


def _list_formats(rows: Iterable[Format]) -> str:
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
