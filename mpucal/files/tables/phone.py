"""Tables of one sensor each in a folder or a .zip: phyphox, Sensor Logger, MetaBase, ulog2csv.

Sensor Logger's Accelerometer.csv excludes gravity; TotalAcceleration.csv and AccelerometerUncalibrated.csv include it.
Of several accelerometers, the one with gravity that is nearest to the sensor's own output is read.
"""

from __future__ import annotations

import lzma
import re
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...data import Recording, Vector
from ...errors import RecordingError
from ...result.session_files import CAPTURE, CAPTURE_OF_VEHICLE
from ..budget import HELD, check_size
from ..hints import NO_HINTS, Hints
from ..reading import reading
from .app_metadata import is_app_metadata, read_app_metadata
from .names import ACC, GYR, Column, first_triple, parse_axis_name
from .streams import are_counts, join_streams
from .table import columns_by_hint, sensor_stream
from .text import TextTable, decode_text, find_table
from .times import Stream
from .units import QUANTITIES, acceleration_unit, to_signed

# names of a sensor's tables, the one nearest to the sensor's own output first
NAMES = {
    ACC: (
        "accelerometeruncalibrated",
        "accelerometer",
        "acceleration",
        "totalacceleration",
        "acc",
        "accel",
        "acce",
        "accm",
    ),
    GYR: ("gyroscopeuncalibrated", "gyroscope", "gyro", "gyr", "gyrm", "rotationrate"),
}
# the unit of tables that name none
UNITS = {ACC: "", GYR: "rad/s"}
# imu_tk names tables of text .mat
SUFFIXES = (".csv", ".txt", ".tsv", ".mat")
# whole numbers that are all smaller are not counts
FEWEST_COUNTS = 200
# RuntimeError includes NotImplementedError, of an unknown compression
_DAMAGE = (zipfile.BadZipFile, RuntimeError, EOFError, ValueError, zlib.error, lzma.LZMAError)


def is_folder_of_tables(path: Path) -> bool:
    """Return True if a folder holds a table of an accelerometer and one of a gyroscope, and no session."""
    names = {child.name for child in path.iterdir()}
    return _has_both(names) and not names & {CAPTURE.name, CAPTURE_OF_VEHICLE.name}


def is_archive_of_tables(path: Path) -> bool:
    """Return True if an archive holds a table of an accelerometer and one of a gyroscope."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _has_both(archive.namelist())
    except (OSError, *_DAMAGE):
        return False


def load_folder_of_tables(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a folder's tables.

    Raises
    ------
    RecordingError : a table cannot be read, or the two do not make a recording.
    """
    with reading(path):
        files = sorted(child for child in (*path.iterdir(), *path.glob("meta/time.csv")) if child.is_file())
        names = {child: child.relative_to(path).as_posix() for child in files}
        texts = {name: child.read_bytes() for child, name in names.items() if _is_read(name)}
    return _recording(path.name, texts, hints)


def load_archive_of_tables(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in an archive's tables; see load_folder_of_tables."""
    try:
        with reading(path), zipfile.ZipFile(path) as archive:
            members = [member for member in archive.infolist() if _is_read(member.filename)]
            check_size(path, HELD * sum(member.file_size for member in members))
            texts = {member.filename: archive.read(member) for member in members}
    except _DAMAGE as error:
        raise RecordingError(f"{path} is not a whole archive ({error})", "export the recording again") from error
    return _recording(path.name, texts, hints)


def _is_read(name: str) -> bool:
    return bool(_sensor(name)) or is_app_metadata(name)


def _sensor(name: str) -> str:
    """Return the quantity that a table of this name holds; empty for another file."""
    return next((quantity for quantity in NAMES if _rank(name, quantity) is not None), "")


def _rank(name: str, quantity: str) -> int | None:
    """Return the index in NAMES of a table's name or a word of it; None for another file."""
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES or "meta" in path.parts[:-1] or path.name.startswith("."):
        return None
    words = [word for word in re.split(r"[^a-z]+", path.stem.lower()) if word]
    for word in ("".join(words), *words):
        if word in NAMES[quantity] and not {"linear", "user"} & set(words):
            return NAMES[quantity].index(word)
    return None


def _has_both(names: Iterable[str]) -> bool:
    return {_sensor(name) for name in names} >= {ACC, GYR}


def _recording(name: str, texts: Mapping[str, bytes], hints: Hints) -> Recording:
    found: dict[str, tuple[str, Stream]] = {}
    without_gravity = ""
    metadata = read_app_metadata({member: data for member, data in texts.items() if is_app_metadata(member)})
    for quantity in NAMES:
        ranks = {member: rank for member in texts if (rank := _rank(member, quantity)) is not None}
        for member in sorted(ranks, key=lambda m: (ranks[m], m)):
            stream = _stream(f"{name}/{Path(member).name}", texts[member], quantity, hints)
            if quantity == ACC and len(stream.values) and not _holds_gravity(stream.values):
                without_gravity = without_gravity or member
                continue
            found.setdefault(quantity, (member, stream))
    if ACC not in found and without_gravity:
        raise RecordingError(
            f"{name}: the median |a| of {Path(without_gravity).name} is not gravity in any unit",
            "record the accelerometer with gravity (TotalAcceleration, AccelerometerUncalibrated)",
        )
    if set(found) < {ACC, GYR}:
        raise RecordingError(f"{name} does not hold tables of both an accelerometer and a gyroscope", "record both")
    (of_acc, acc), (of_gyr, gyr) = found[ACC], found[GYR]
    acc = replace(acc, values=-acc.values if metadata.sign_flipped else acc.values, zero_ns=metadata.zero_ns)
    of = f"from {Path(of_acc).name} and {Path(of_gyr).name}"
    return join_streams(acc, gyr, hints, name, remarks=[of, *metadata.remarks])


def _holds_gravity(values: Vector) -> bool:
    return bool(acceleration_unit(values)) or _are_counts(values)


def _are_counts(values: Vector) -> bool:
    return len(values) > 0 and are_counts(to_signed(values)) and bool(np.abs(values).max() > FEWEST_COUNTS)


def _stream(name: str, data: bytes, quantity: str, hints: Hints) -> Stream:
    text, hinted = decode_text(data, name), _hinted_columns(hints, quantity)
    if hinted:
        table = find_table(text, name, list(hinted.values()))
    else:
        table = find_table(text, name) or find_table(text, name, bare=True) or _unnamed_table(text, name)
    if table is None or not table.rows:
        raise RecordingError(
            f"{name} names no columns x, y and z",
            "name its columns in its first line (time, x, y, z), or give their order with --columns t,ax,ay,az",
        )
    columns = columns_by_hint(table.header, replace(hints, columns=hinted)) if hinted else table.columns
    of = first_triple(columns, quantity) or _columns_without_sensor(table, quantity)
    if not of:
        raise RecordingError(
            f"{name} holds the columns {', '.join(table.header)}, but no {quantity}", "record both sensors"
        )
    stream = sensor_stream(table, columns, of)
    # the unit was assumed, and counts disprove it
    return stream if of[0].unit != UNITS[quantity] or not _are_counts(stream.values) else replace(stream, unit="")


def _hinted_columns(hints: Hints, quantity: str) -> dict[str, str | int]:
    """Return role -> column of one sensor's table; the gyroscope's default to the accelerometer's."""
    letter = "a" if quantity == ACC else "g"
    of = letter if f"{letter}x" in hints.columns else "a"
    found = {role.replace(of, letter): where for role, where in hints.columns.items() if role[0] in (of, "t")}
    return found if len(found) > 1 else {}


def _unnamed_table(text: str, name: str) -> TextTable | None:
    """Return a table of four numbers a line, as data sets have them: time, x, y, z; None for another."""
    table = find_table(text, name, range(4))
    if table is None or any(len(row) != 4 for row in table.rows):
        return None
    return replace(table, header=["time", "x", "y", "z"])


def _columns_without_sensor(table: TextTable, quantity: str) -> tuple[Column, ...]:
    """Return the columns x, y, z of a table whose file name alone names the sensor; empty if there are none."""
    found = {axis[0]: (place, axis[1]) for place, name in enumerate(table.header) if (axis := parse_axis_name(name))}
    if set(found) != {0, 1, 2}:
        return ()
    return tuple(
        Column(table.header[place], place, quantity, i, unit or UNITS[quantity])
        for i, (place, unit) in sorted(found.items())
        if unit in ("", *QUANTITIES[quantity])
    )
