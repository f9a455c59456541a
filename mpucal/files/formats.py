"""Table of the formats of recording files; a format's module is imported when such a file is read or written.

Several formats may share a suffix. The first one that recognises a file reads it. If none does, the one with `fallback`
reads it, so that the error message says what is wrong with the file.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, NamedTuple

from ..arguments import check_regular
from ..data import Recording
from ..errors import OutputError, RecordingError, UsageError
from ..result.session_files import CAPTURE, CAPTURE_OF_VEHICLE, SessionFile
from .hints import NO_HINTS, Hints
from .reading import FILE_PER_MEMORY, check_size, first_bytes, is_text
from .rows import Rows, Write

FOLDER, ANY_TEXT = "/", ".txt"


class Format(NamedTuple):
    """A format of recording files, with the names of its functions, such as "package.module:function"; empty: none.

    A name that begins with a point is relative to this package.

    Attributes
    ----------
    suffixes : of its files' names, in lower case, with blanks between; FOLDER for a folder.
    what : the content of such a file, in words with an article.
    load : (path) -> Recording, the whole file. rows : (path) -> Rows, in bounded memory. One of them is enough.
    recognises : (path) -> bool, True if a file with such a suffix is of this format. Empty: every such file is.
    writer : (path, rows, done) -> context of a Write; see open_writer.
    session : the capture file of sessions in this format; `load` and `rows` then take all parts of a resumed session.
    hinted : `load` and `rows` also take Hints; with hints, this format reads files that it does not recognise.
    fallback : this format reads files with its suffixes that no format recognises.
    """

    suffixes: str
    what: str
    load: str = ""
    recognises: str = ""
    rows: str = ""
    writer: str = ""
    session: SessionFile | None = None
    hinted: bool = False
    fallback: bool = False

    @property
    def of(self) -> list[str]:
        """Return the suffixes, one by one."""
        return self.suffixes.split()

    @property
    def is_read(self) -> bool:
        """Return True if files of this format can be read."""
        return bool(self.load or self.rows)

    def matches(self, path: Path) -> bool:
        """Return True if the file or folder looks like this format; it is not read to its end."""
        return _suffix(path) in self.of and (not self.recognises or bool(_function(self.recognises)(path)))

    def read(self, *paths: Path, hints: Hints = NO_HINTS) -> Recording:
        """Return the whole recording; see load."""
        for path in paths:
            check_size(path, path.stat().st_size if path.is_file() else 0, FILE_PER_MEMORY)
        if not self.load:
            return self.read_rows(*paths).recording()
        recording: Recording = _function(self.load)(*paths, *([hints] if self.hinted else []))
        return recording

    def read_rows(self, *paths: Path, hints: Hints = NO_HINTS) -> Rows:
        """Return the recording a run of samples at a time; see open_rows."""
        if not self.rows:
            return Rows.of(self.read(*paths, hints=hints))
        rows: Rows = _function(self.rows)(*paths, *([hints] if self.hinted else []))
        return rows

    def write(self, path: Path, rows: Rows, done: str) -> AbstractContextManager[Write]:
        """Open a new file of this format; see open_writer."""
        context: AbstractContextManager[Write] = _function(self.writer)(path, rows, done)
        return context


def _function(name: str) -> Any:
    return resolve_name(f"{__package__}{name}" if name.startswith(".") else name)


PACKED = ".zip .gz"
_TEXTS = ".csv .txt .log .tsv"
TABLES = f"{_TEXTS} .mat .npy .json .parquet"
_BAG: dict[str, Any] = {"load": ".ros:load_bag", "rows": ".ros:bag_rows", "hinted": True}
_ARRAYS: dict[str, Any] = {"load": ".arrays:load_arrays", "hinted": True}
_PAIR: dict[str, Any] = {"load": ".tables.phone:load_tables", "hinted": True}
_ANY: dict[str, Any] = {"hinted": True, "fallback": True}
FORMATS = (
    Format(".mcap", "a bag of ROS 2", recognises=".mcap:is_mcap_of_ros", **_BAG),
    Format(".mcap", "a capture", ".capture:load_capture", rows=".capture:capture_rows", session=CAPTURE),
    Format(".tlog", "a MAVLink log", ".vehicle_logs:load_tlog", session=CAPTURE_OF_VEHICLE),
    Format(".bin", "a dataflash log of ArduPilot", ".vehicle_logs:load_dataflash", ".vehicle_logs:is_dataflash"),
    # Other .bin files are read if a user names one, but are not recognised as recordings in a folder.
    Format(".bin", "records of numbers", ".records:load_records", ".vehicle_logs:is_dataflash", **_ANY),
    Format(".ulg", "a log of PX4", ".ulog:load_ulog", hinted=True),
    Format(".db3", "a bag of ROS 2", **_BAG),
    Format(".bag", "a bag of ROS 1", **_BAG),
    Format(TABLES, "a phone's tables", recognises=".tables.phone:is_of_pair", **_PAIR),
    Format(".npz", "another program's archive of NumPy", recognises=".arrays:is_of_others", **_ARRAYS),
    Format(".npy", "an array of NumPy", **_ARRAYS),
    Format(".mat", "a file of MATLAB", **_ARRAYS),
    Format(".h5 .hdf5 .hdf", "a file of HDF5", **_ARRAYS),
    Format(".json .jsonl .ndjson", "samples in JSON", recognises=".arrays:is_json_of_samples", **_ARRAYS),
    Format(".npz", "a NumPy archive", rows=".npz:npz_rows", writer=".npz:npz_file"),
    Format(".parquet .feather", "a file of Arrow", **_ARRAYS),
    Format(".xlsx", "a workbook", ".workbook:load_workbook", hinted=True),
    Format(".csv", "a table", recognises=".tables.load:is_own_table", rows=".csv:csv_rows", writer=".csv:csv_file"),
    Format(_TEXTS, "another program's table", ".tables.load:load_table", ".tables.load:is_table", **_ANY),
    Format(PACKED, "an archive of recordings", ".archive:load_archive", ".archive:is_archive", hinted=True),
    Format(".mcap", "sensor_msgs/Imu for ROS 2 and Foxglove", writer=".imu:imu_file"),
    Format(FOLDER, "the folder of a bag", recognises=".ros:is_folder_of_ros", **_BAG),
    Format(FOLDER, "the folder of a phone's tables", recognises=".tables.phone:is_folder", **_PAIR),
    Format(FOLDER, "a folder of recordings of one sensor", ".folder:load_parts", ".folder:holds_parts", hinted=True),
    Format(FOLDER, "the folder of a session", ".folder:load_folder", rows=".folder:folder_rows"),
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
    of_suffix = [row for row in FORMATS if row.is_read and _suffix(path) in row.of]
    found = recognise(path)
    if hints.given and not (found and found.hinted):
        # Hints choose the reader of another program's file, but a recording of mpucal's own sessions needs none.
        if not (found and (found.session or FOLDER in found.of)):
            found = next((row for row in reversed(of_suffix) if row.hinted), found)
        if found is None or not found.hinted:
            what = found.what if found else "not a recording that mpucal knows"
            raise UsageError(
                f"{path} is {what}; it needs no options on how to read it",
                "leave out --topic, --sensor, --columns, --units, --accel-range, --gyro-range and --rate",
            )
    # A suffix that no format has is not read by the fallback: such a text need not be a table.
    found = found or next((row for row in of_suffix if row.fallback and path.suffix.lower() in row.of), None)
    if found is None:
        if of_suffix and path.stat().st_size == 0:
            raise RecordingError(f"{path} is empty", "record it again")
        shows = f"give a recording; `{shlex.join(['mpucal', 'show', str(path)])}` shows a calibration"
        holds_none = of_suffix and path.suffix.lower() not in PACKED.split()
        remedy = shows if holds_none else f"export a table as .csv, or give {_suffixes()}"
        raise RecordingError(f"{path} is not a recording that mpucal knows", remedy)
    return found


def _suffix(path: Path) -> str:
    """Return the suffix by which the format is found: ANY_TEXT for text with an unknown one, such as .dat or .lvm."""
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
    written = {suffix: row for row in FORMATS if row.writer for suffix in row.of}
    if path.suffix.lower() not in written:
        raise OutputError(f"mpucal cannot write a file like {path}", f"end its name with {', '.join(written)}")
    return written[path.suffix.lower()]


def is_suffix(suffix: str) -> bool:
    """Return True if a format that can be read has this suffix."""
    return any(row.is_read and suffix.lower() in row.of for row in FORMATS)


def readable_formats() -> str:
    """Return the formats that can be read, as text."""
    return _list_formats(row for row in FORMATS if row.is_read)


def writable_formats() -> str:
    """Return the formats that can be written, as text."""
    return _list_formats(row for row in FORMATS if row.writer)


def _list_formats(rows: Iterable[Format]) -> str:
    suffixes: dict[str, list[str]] = {}
    for row in rows:
        suffixes.setdefault(row.what, []).extend(row.of)
    *others, last = (f"{what} ({', '.join(of)})".removesuffix(f" ({FOLDER})") for what, of in suffixes.items())
    return f"{', '.join(others)} or {last}"


def _suffixes() -> str:
    """Return what can be read, by suffix, as text: first mpucal's own files, then those of other programs."""
    read = [(suffix, row) for row in FORMATS if row.is_read for suffix in row.of]
    folders = " or ".join(row.what for suffix, row in read if suffix == FOLDER and not row.hinted)
    own = dict.fromkeys(suffix for suffix, row in read if suffix != FOLDER and not row.hinted)
    others = ", ".join(dict.fromkeys(suffix for suffix, _ in read if suffix not in (FOLDER, *own)))
    return f"a {', '.join(own)} file or {folders}, or of another program a {others} file or a folder"
