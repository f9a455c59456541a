"""Tables of a phone's sensors, one of each, as phyphox and Sensor Logger leave them in a folder or a .zip.

Sensor Logger's Accelerometer.csv is without gravity; TotalAcceleration.csv and AccelerometerUncalibrated.csv are with
it. Of several accelerometers the one is taken that is nearest to the sensor and holds gravity.
"""

from __future__ import annotations

import lzma
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path

from ...data import Recording
from ...errors import RecordingError
from ..hints import NO_HINTS, Hints
from ..rows import cannot_read
from .names import ACC, GYR, Column, three
from .streams import Stream, recording_of
from .table import stream_of
from .text import TextTable, table_of, text_of
from .units import acceleration_unit

# a sensor's tables by their names, the one nearest to the sensor first; the unit where their program says none
NAMES = {
    ACC: ("accelerometeruncalibrated", "accelerometer", "acceleration", "totalacceleration", "acc", "accel"),
    GYR: ("gyroscopeuncalibrated", "gyroscope", "gyro", "gyr", "rotationrate"),
}
UNITS = {ACC: "", GYR: "rad/s"}
SUFFIXES = (".csv", ".txt", ".tsv")
# NotImplementedError is a RuntimeError: another way to compress
_DAMAGE = (zipfile.BadZipFile, RuntimeError, EOFError, ValueError, zlib.error, lzma.LZMAError)
# members of an archive are read whole
MOST_BYTES = 1 << 30


def is_folder_of_tables(path: Path) -> bool:
    """Whether a folder holds a table of an accelerometer and one of a gyroscope."""
    return _has_both(child.name for child in path.iterdir())


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
        texts = {child.name: child.read_bytes() for child in sorted(path.iterdir()) if _sensor(child.name)}
    except OSError as error:
        raise cannot_read(path, error) from error
    return _recording(path.name, texts, hints)


def load_archive_of_tables(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """The recording in an archive's tables; see load_folder_of_tables."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = [member for member in archive.infolist() if _sensor(member.filename)]
            if sum(member.file_size for member in members) > MOST_BYTES:
                raise RecordingError(
                    f"{path} holds more than {MOST_BYTES >> 20} MiB of tables", "unpack it, and give one"
                )
            texts = {member.filename: archive.read(member) for member in members}
    except OSError as error:
        raise cannot_read(path, error) from error
    except _DAMAGE as error:
        raise RecordingError(f"{path} is no whole archive ({error})", "export the recording again") from error
    return _recording(path.name, texts, hints)


def _sensor(name: str) -> str:
    """The quantity that a table of this name holds; empty of another."""
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES or "meta" in path.parts[:-1] or path.name.startswith("."):
        return ""
    stem = _plain(name)
    return next((quantity for quantity, names in NAMES.items() if stem in names), "")


def _plain(name: str) -> str:
    return "".join(filter(str.isalnum, Path(name).stem.lower()))


def _has_both(names: Iterable[str]) -> bool:
    return {_sensor(name) for name in names} >= {ACC, GYR}


def _recording(name: str, texts: Mapping[str, bytes], hints: Hints) -> Recording:
    found: dict[str, tuple[str, Stream]] = {}
    without_gravity = ""
    for quantity, names in NAMES.items():
        for member in sorted((m for m in texts if _sensor(m) == quantity), key=lambda m: names.index(_plain(m))):
            stream = _stream(f"{name}/{Path(member).name}", texts[member], quantity)
            if quantity == ACC and len(stream.values) and not acceleration_unit(stream.values):
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
    said = f"from {Path(of_acc).name} and {Path(of_gyr).name}"
    return recording_of(acc, gyr, hints, name, remarks=[said])


def _stream(name: str, data: bytes, quantity: str) -> Stream:
    text = text_of(data, name)
    table = table_of(text, name) or table_of(text, name, bare=True)
    if table is None or not table.rows:
        raise RecordingError(f"{name} names no columns x, y and z", "export the recording again")
    columns = table.columns
    of = three(columns, quantity) or _bare(table, quantity)
    if not of:
        raise RecordingError(
            f"{name} holds the columns {', '.join(table.header)}, and no {quantity}", "record both sensors"
        )
    return stream_of(table, columns, of)


def _bare(table: TextTable, quantity: str) -> tuple[Column, ...]:
    """x, y, z where the file's name alone says of what."""
    named = {header.strip().lower(): place for place, header in enumerate(table.header)}
    if not {"x", "y", "z"} <= set(named):
        return ()
    return tuple(Column(axis, named[axis], quantity, i, UNITS[quantity]) for i, axis in enumerate("xyz"))
