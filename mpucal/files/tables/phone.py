"""Tables of one sensor each in a folder or a .zip: phyphox, Sensor Logger, MetaBase, ulog2csv, imu_tk.

The names of two tables of one recording differ by the sensor's word alone.

Sensor Logger's Accelerometer.csv excludes gravity; TotalAcceleration.csv and AccelerometerUncalibrated.csv include it.
Of several accelerometers, the one with gravity that is nearest to the sensor's own output is read. Its Metadata.csv has
the platform: on iOS accelerations have the opposite sign, unless `standardisation` is true
(tszheichoi/awesome-sensor-logger, COORDINATES.md). phyphox's meta/time.csv has the time of day of each start
(phyphox-ios, ExperimentExport.swift); phyphox corrects the sign itself.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from decimal import Decimal
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from ...arguments import reading
from ...clocks import S
from ...data import Recording
from ...errors import RecordingError
from ...result.session_files import captures_in
from ..array_files import holds_arrays, read_arrays
from ..formats import TABLES
from ..hints import NO_HINTS, Hints
from ..reading import MEMORY_PER_TEXT, check_size, first_bytes
from .array_table import table_of_arrays
from .columns import columns_by_hint
from .load import FLIPPED, find_any_table, is_table_of_sensors, with_sensor_of_file
from .names import ACC, GYR, HYPHEN, TIME, first_triple, with_sensor
from .sensor import sensor_stream
from .shown_units import acceleration_unit, seem_counts
from .streams import join_streams
from .table import Table
from .text import decode_text
from .times import Stream, how_often

# names of a sensor's tables, the one nearest to the sensor's own output first
_OF_ACC = "accelerometeruncalibrated accelerometer acceleration totalacceleration acc accel acce accm alpha"
_OF_GYR = "gyroscopeuncalibrated gyroscope gyro gyr gyrm rotationrate angularvelocity omega"
NAMES = {ACC: _OF_ACC.split(), GYR: _OF_GYR.split()}
# letters of the longest of the words that are no app's
SHORT = len("accel")
METADATA, TIMES_OF_DAY = "metadata.csv", "meta/time.csv"
# of a table within a file
OF_FILE = ".table"
SIDE = re.compile(r"(?<![a-z])(?:[xyz]|up|down|left|right|top|bottom|front|back|face|side)(?![a-z])")


def is_folder(path: Path) -> bool:
    """Return True if a folder holds a table of an accelerometer and one of a gyroscope, and no session."""
    names = {child.name for child in path.iterdir()}
    return bool(_pairs(names)) and not tables_of_sides(names) and not captures_in(path)


def tables_of_sides(names: Iterable[str]) -> list[str]:
    """Return the accelerometer's table of each pair, if pairs are called after the sides of a board; else none."""
    found = [next(member for member in pair if member.quantity == ACC) for pair in _pairs(names)]
    of_sides = len(found) > 1 and all(SIDE.search(member.rest) for member in found)
    return [member.name for member in found] if of_sides else []


def is_of_pair(path: Path) -> bool:
    """Return True if a file is a table of one sensor, beside that of the other."""
    try:
        found = _parse(path.name)
        beside = map(_parse, [child.name for child in path.parent.iterdir()] if found else [])
        if found is None or {of.quantity for of in beside if of and of.rest == found.rest} != {ACC, GYR}:
            return False
        text = "" if holds_arrays(path) else decode_text(first_bytes(path), path.name)
        return not is_table_of_sensors(text, path.name)
    except (OSError, RecordingError):
        return False


def load_tables(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a table and the one beside it; or in a folder's tables, the first pair if several are.

    Raises
    ------
    RecordingError : a table cannot be read, or the two do not make a recording.
    """
    folder, wanted = (path, "") if path.is_dir() else (path.parent, path.name)
    with reading(folder):
        files = sorted(child for child in (*folder.iterdir(), *folder.glob("meta/time.csv")) if child.is_file())
        names = [child.relative_to(folder).as_posix() for child in files]

        def read(name: str) -> bytes | Table | None:
            file = folder / name
            if holds_arrays(file):
                return table_of_arrays(name, read_arrays(file))
            check_size(folder, MEMORY_PER_TEXT * file.stat().st_size)
            return file.read_bytes()

        return _recording(path.name, names, read, wanted, hints)


def is_pair(tables: Mapping[str, Table]) -> bool:
    """Return True if two tables are called as an accelerometer's and a gyroscope's, and have clocks of their own."""
    timed = [f"{name}{OF_FILE}" for name, of in tables.items() if any(c.quantity == TIME for c in of.columns)]
    return bool(_pairs(timed))


def recording_of_tables(name: str, tables: Mapping[str, Table], hints: Hints) -> Recording:
    """Return the recording in a pair of tables in a file."""
    found = {f"{of}{OF_FILE}": table for of, table in tables.items()}
    return _recording(name, found, found.__getitem__, "", hints)


class _Member(NamedTuple):
    """A table of one sensor: its rank among those of the sensor, and its name without the sensor's word."""

    rest: str
    quantity: str
    rank: int
    name: str

    @property
    def is_short(self) -> bool:
        """Return True if the sensor's word is a short one, such as acc or gyro, and not an app's."""
        return len(NAMES[self.quantity][self.rank]) <= SHORT


def _parse(name: str) -> _Member | None:
    """Return the table of that name; None for other files."""
    path = Path(name)
    if path.suffix.lower() not in (*TABLES.split(), OF_FILE) or "meta" in path.parts[:-1] or path.name.startswith("."):
        return None
    stem = re.sub(HYPHEN, "-", path.stem)
    words = re.findall("[a-z]+", re.sub("(?<=[a-z])(?=[A-Z])", " ", stem).lower())
    stem = stem.lower()
    for quantity, known in NAMES.items():
        for word in ("".join(words), *words):
            if word in known and not {"linear", "user"} & set(words):
                rest = f"{path.parent}/{stem.replace(word, '', 1) if word in stem else ''}"
                return _Member(rest, quantity, known.index(word), name)
    return None


def _pairs(names: Iterable[str]) -> list[list[_Member]]:
    """Return the tables of each pair, the best of each sensor first; all tables as one if their names do not agree."""
    members = sorted(filter(None, map(_parse, set(names))))
    pairs = [list(pair) for _, pair in groupby(members, lambda member: member.rest)]
    pairs += [sorted(members, key=lambda member: member[1:])]
    both = [pair for pair in pairs if {member.quantity for member in pair} == {ACC, GYR}]
    return both[:-1] or both


def _recording(
    name: str, names: Iterable[str], read: Callable[[str], bytes | Table | None], wanted: str, hints: Hints
) -> Recording:
    """Return the recording in the pair of tables that holds `wanted`, or in the first."""
    pairs = _pairs(names)
    pair = next((pair for pair in pairs if wanted in {member.name for member in pair}), pairs[0])
    chosen = next((member for member in pair if member.name == wanted), pair[0])
    beside = [(member, read(member)) for member in names if member.lower().endswith((METADATA, TIMES_OF_DAY))]
    flipped, zero_ns, remark = _read_app_metadata([(name, data) for name, data in beside if isinstance(data, bytes)])

    def stream_of(quantity: str) -> tuple[str, Stream]:
        """Return the first table that can be read, of an accelerometer with gravity if there is one."""
        found: list[tuple[str, Stream]] = []
        # gyro.csv is more likely the partner of accel.csv than gyroscope.csv is
        alike = sorted(pair, key=lambda member: wanted != "" and member.is_short != chosen.is_short)
        members = [member.name for member in alike if member.quantity == quantity]
        for member in members:
            try:
                # beside a file that was given, or in the working directory, a name alone says where it is
                of = Path(member).name if wanted or not name else f"{name}/{Path(member).name}"
                found.append((member, _stream(of, read(member), quantity, hints)))
            except RecordingError:
                # another table of that sensor may do
                if member == members[-1] and not found:
                    raise
        return next((of for of in found if quantity == GYR or _holds_gravity(of[1])), found[0])

    (of_acc, acc), (of_gyr, gyr) = stream_of(ACC), stream_of(GYR)
    acc = replace(acc, values=-acc.values if flipped else acc.values, zero_ns=zero_ns)
    of = " and ".join(Path(member).name.removesuffix(OF_FILE) for member in (of_acc, of_gyr))
    more = f"of {len(pairs)} pairs of tables, it is the first; give one file of another pair to read that"
    remarks = [f"from {of}", more if len(pairs) > 1 and not wanted else "", remark]
    return join_streams(acc, gyr, hints, name or "the folder", remarks=remarks)


def _read_app_metadata(files: Iterable[tuple[str, bytes]]) -> tuple[bool, int | None, str]:
    """Return what an app wrote beside its tables: if the sign is iOS's, time of day at time 0 [ns], and a remark."""
    flipped, zero_ns, remark = False, None, ""
    for name, data in files:
        with suppress(RecordingError, csv.Error):
            text = decode_text(data, name)
            separator = next((cell for cell in ",;\t" if cell in text.partition("\n")[0]), ",")
            read = csv.DictReader(text.splitlines(), delimiter=separator, restkey="")
            rows = [{(key or "").lower(): cell or "" for key, cell in row.items()} for row in read]
            starts = [row for row in rows if row.get("event", "").upper() == "START"]
            if len(starts) > 1:
                remark = f"it was paused {how_often(len(starts) - 1)}, and its times do not count the pauses"
            elif starts:
                with suppress(KeyError, ArithmeticError, ValueError):
                    of_day, at = (Decimal(starts[0][of].replace(",", ".")) for of in ("system time", "experiment time"))
                    zero_ns = int((of_day - at) * S)
            elif [row.get("platform", "").lower() for row in rows[:1]] == ["ios"]:
                flipped = rows[0].get("standardisation", "").lower() != "true"
                remark = FLIPPED if flipped else remark
    return flipped, zero_ns, remark


def _holds_gravity(stream: Stream) -> bool:
    values = stream.values[stream.complete]
    return seem_counts(values) or (len(values) > 0 and bool(acceleration_unit(values)))


def _stream(name: str, data: bytes | Table | None, quantity: str, hints: Hints) -> Stream:
    hinted = _hinted_columns(hints, quantity)
    if isinstance(data, bytes):
        data = find_any_table(decode_text(data, name), name, list(hinted.values()))
    table = data
    if table is None or not len(table):
        raise RecordingError(
            f"{name} names no columns x, y and z",
            "name its columns in its first line (time, x, y, z), or give their order with --columns t,ax,ay,az",
        )
    called = [table, replace(table, header=with_sensor(table.header, quantity)), with_sensor_of_file(table)]
    table = next((of for of in called if first_triple(of.columns, quantity)), table)
    columns = columns_by_hint(table, hinted) if hinted else table.columns
    of = first_triple(columns, quantity)
    if not of:
        raise RecordingError(
            f"{name} holds the columns {', '.join(table.header)}, but no {quantity}", "record both sensors"
        )
    stream = sensor_stream(table, table.clocks(columns), of)
    # of a phone, by the convention of Android and iOS, where a line above names the columns
    named = len(table.lines) > 0 and table.lines[0] > 1
    is_phones = quantity == GYR and named and not seem_counts(stream.values[stream.complete])
    return replace(stream, unit="rad/s") if is_phones and not stream.unit else stream


def _hinted_columns(hints: Hints, quantity: str) -> dict[str, str | int]:
    """Return role -> column of one sensor's table; the gyroscope's default to the accelerometer's."""
    letter = "a" if quantity == ACC else "g"
    of = letter if f"{letter}x" in hints.columns else "a"
    found = {role.replace(of, letter): where for role, where in hints.columns.items() if role[0] in (of, "t")}
    return found if len(found) > 1 else {}
