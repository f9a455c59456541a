"""Tables of one sensor each in a folder or a .zip: phyphox, Sensor Logger, MetaBase, ulog2csv.

Sensor Logger's Accelerometer.csv is without gravity; TotalAcceleration.csv and AccelerometerUncalibrated.csv are with
it. Of several accelerometers the one is taken that is nearest to the sensor and holds gravity.
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
from ..budget import HELD, afford
from ..hints import NO_HINTS, Hints
from ..rows import cannot_read
from .apps import is_about, said
from .names import ACC, GYR, Column, bare_axis, three
from .streams import are_counts, recording_of
from .table import chosen, stream_of
from .text import TextTable, table_of, text_of
from .times import Stream
from .units import QUANTITIES, acceleration_unit, signed

# a sensor's tables by their names, the one nearest to the sensor first; the unit where their program says none
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
UNITS = {ACC: "", GYR: "rad/s"}
# imu_tk calls tables of text .mat
SUFFIXES = (".csv", ".txt", ".tsv", ".mat")
# of an accelerometer's largest: whole numbers that are smaller are no counts
FEWEST_COUNTS = 200
# NotImplementedError is a RuntimeError: another way to compress
_DAMAGE = (zipfile.BadZipFile, RuntimeError, EOFError, ValueError, zlib.error, lzma.LZMAError)


def is_folder_of_tables(path: Path) -> bool:
    """Whether a folder holds a table of an accelerometer and one of a gyroscope, and no session."""
    names = {child.name for child in path.iterdir()}
    return _has_both(names) and not names & {CAPTURE.name, CAPTURE_OF_VEHICLE.name}


def is_archive_of_tables(path: Path) -> bool:
    """Whether an archive holds them."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _has_both(archive.namelist())
    except (OSError, *_DAMAGE):
        return False


def load_folder_of_tables(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """The recording in a folder's tables.

    Raises
    ------
    RecordingError : one cannot be read, or both do not make a recording.
    """
    try:
        files = sorted(child for child in (*path.iterdir(), *path.glob("meta/time.csv")) if child.is_file())
        names = {child: child.relative_to(path).as_posix() for child in files}
        texts = {name: child.read_bytes() for child, name in names.items() if _is_read(name)}
    except OSError as error:
        raise cannot_read(path, error) from error
    return _recording(path.name, texts, hints)


def load_archive_of_tables(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """The recording in an archive's tables; see load_folder_of_tables."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = [member for member in archive.infolist() if _is_read(member.filename)]
            afford(path, HELD * sum(member.file_size for member in members))
            texts = {member.filename: archive.read(member) for member in members}
    except OSError as error:
        raise cannot_read(path, error) from error
    except _DAMAGE as error:
        raise RecordingError(f"{path} is no whole archive ({error})", "export the recording again") from error
    return _recording(path.name, texts, hints)


def _is_read(name: str) -> bool:
    return bool(_sensor(name)) or is_about(name)


def _sensor(name: str) -> str:
    """The quantity that a table of this name holds; empty of another."""
    return next((quantity for quantity in NAMES if _rank(name, quantity) is not None), "")


def _rank(name: str, quantity: str) -> int | None:
    """The place of a table among those of the quantity, by its name or a word of it; None of another."""
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
    about = said({member: data for member, data in texts.items() if is_about(member)})
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
            f"{name}: |a| of {Path(without_gravity).name} is not gravity in the median, in no unit",
            "record the accelerometer with gravity (TotalAcceleration, AccelerometerUncalibrated)",
        )
    if set(found) < {ACC, GYR}:
        raise RecordingError(f"{name} holds no table of both an accelerometer and a gyroscope", "record both")
    (of_acc, acc), (of_gyr, gyr) = found[ACC], found[GYR]
    acc = replace(acc, values=-acc.values if about.turned_around else acc.values, zero_ns=about.zero_ns)
    of = f"from {Path(of_acc).name} and {Path(of_gyr).name}"
    return recording_of(acc, gyr, hints, name, remarks=[of, *about.remarks])


def _holds_gravity(values: Vector) -> bool:
    return bool(acceleration_unit(values)) or _are_counts(values)


def _are_counts(values: Vector) -> bool:
    return len(values) > 0 and are_counts(signed(values)) and bool(np.abs(values).max() > FEWEST_COUNTS)


def _stream(name: str, data: bytes, quantity: str, hints: Hints) -> Stream:
    text, said = text_of(data, name), _said(hints, quantity)
    if said:
        table = table_of(text, name, list(said.values()))
    else:
        table = table_of(text, name) or table_of(text, name, bare=True) or _of_four(text, name)
    if table is None or not table.rows:
        raise RecordingError(
            f"{name} names no columns x, y and z",
            "name its columns in its first line (time, x, y, z), or say their order with --columns t,ax,ay,az",
        )
    columns = chosen(table.header, replace(hints, columns=said)) if said else table.columns
    of = three(columns, quantity) or _bare(table, quantity)
    if not of:
        raise RecordingError(
            f"{name} holds the columns {', '.join(table.header)}, and no {quantity}", "record both sensors"
        )
    stream = stream_of(table, columns, of)
    # a unit that nothing says is none of counts
    return stream if of[0].unit != UNITS[quantity] or not _are_counts(stream.values) else replace(stream, unit="")


def _said(hints: Hints, quantity: str) -> dict[str, str | int]:
    """Role -> column of one sensor's table; where the gyroscope's are not said they are as the accelerometer's."""
    letter = "a" if quantity == ACC else "g"
    of = letter if f"{letter}x" in hints.columns else "a"
    found = {role.replace(of, letter): where for role, where in hints.columns.items() if role[0] in (of, "t")}
    return found if len(found) > 1 else {}


def _of_four(text: str, name: str) -> TextTable | None:
    """A table of four numbers a line, as data sets have them: time, x, y, z."""
    table = table_of(text, name, range(4))
    if table is None or any(len(row) != 4 for row in table.rows):
        return None
    return replace(table, header=["time", "x", "y", "z"])


def _bare(table: TextTable, quantity: str) -> tuple[Column, ...]:
    """x, y, z where the file's name alone says of what."""
    found = {axis[0]: (place, axis[1]) for place, name in enumerate(table.header) if (axis := bare_axis(name))}
    if set(found) != {0, 1, 2}:
        return ()
    return tuple(
        Column(table.header[place], place, quantity, i, unit or UNITS[quantity])
        for i, (place, unit) in sorted(found.items())
        if unit in ("", *QUANTITIES[quantity])
    )
