"""A table as a recording: of text, which is found first, and of arrays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...arguments import reading
from ...clocks.stamps import FEWEST
from ...data import Recording, Vector
from ...errors import RecordingError
from ..hints import NO_HINTS, ROLES, Hints
from ..reading import MEMORY_PER_TEXT, SNIFFED, check_size, first_bytes
from . import names
from .cells import LOOKED_AT, OF_DAY, Kind
from .columns import find_columns
from .guess import increases, is_clock, is_index
from .labelled import dataflash_text_table, labelled_table, marked_table, pivot
from .names import ACC, GYR, TIME, Column, first_triple, names_both
from .sensor import interval_column, is_weak, sensor_stream
from .several import NAMES_SENSORS, of_one_beginning, of_one_place, of_one_sensor, of_one_turn, turns
from .shown_units import acceleration_unit, likely_rate_hz, offset, seem_counts
from .streams import index_with_gravity, join_streams
from .table import Table
from .text import HEAD, PREAMBLE, decode_text, find_bare_table, find_named_table, find_wanted_table, stated_rate_hz
from .times import Stream
from .units import QUANTITIES

# words of a program's preamble -> units that its names of columns do not say
PROGRAMS = {"MT Manager version": {"t": "0.1ms", "acc": "m/s^2", "gyr": "rad/s"}}
# seconds since 1970, and nanoseconds, as the first cells of `ros2 topic echo --csv`
STAMP = re.compile(r"[12]\d{9},\d{7,9},").match
# bytes in which a board is turned
TURNED_BYTES = 1 << 20
FLIPPED = "accelerations have the opposite sign, as on iOS, and were negated"
# a column of Sensor Logger's tables, and its table of accelerations without gravity
OF_SENSOR_LOGGER, LINEAR = "seconds_elapsed", "accelerometer"
# stems of its one table: the first is in g on iOS; the second does not tell iOS from Android
IN_G_ON_IOS, EITHER_SIGN = "accelerometeruncalibrated_", "totalacceleration_"


def is_table(path: Path) -> bool:
    """Return True if a file begins as a table of a sensor."""
    return _begun(path) is not None


def is_own_table(path: Path) -> bool:
    """Return True if a file begins as a table in mpucal's own format and units."""
    first = next(iter(first_bytes(path).decode("utf-8-sig", "replace").splitlines()), "")
    table = _begun(path) if _names_roles(first.split(",")) else None
    # units in the cells stand in its header
    if table is None or not _names_roles(table.header) or any(map(NAMES_SENSORS, table.header)):
        return False
    if of_one_sensor(table) is not table:
        return False
    if turns(_accelerations(table)) > 1:
        return False
    return _may_be_si(table, path) and not _may_be_no_seconds(table, path)


def _names_roles(header: Sequence[str]) -> bool:
    return set(ROLES) <= {name.strip(' "').lower() for name in header}


def _begun(path: Path, count: int = SNIFFED) -> Table | None:
    try:
        return find_any_table(decode_text(first_bytes(path, count), path.name), path.name)
    except RecordingError:
        return None


def _may_be_si(table: Table, path: Path) -> bool:
    """Return True unless the accelerations show a unit other than m/s^2, or turn about another point than zero."""
    values = _accelerations(table)
    if len(values) < FEWEST or (unit := acceleration_unit(values)) == "m/s^2":
        return True
    turned = None if unit or seem_counts(values) else _begun(path, TURNED_BYTES)
    return turned is not None and offset(_accelerations(turned)) is None


def _accelerations(table: Table) -> Vector:
    values = table.numbers(first_triple(table.columns, ACC))
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def _may_be_no_seconds(table: Table, path: Path) -> bool:
    """Return True if the column t may hold times of day in digits, or decreases.

    So it may if it counts the samples, as the whole file shows.
    """
    place = [name.strip().lower() for name in table.header].index("t")
    if len(table) and OF_DAY(str(table.cells[place][0])):
        return True
    # the part of the file that was read may end within a number
    t = table.numbers([Column("t", place, TIME)])[:-1, 0]
    if len(t) < FEWEST or not is_index(t):
        return len(t) >= FEWEST and not increases(t)
    whole = find_any_table(_read_text(path), path.name)
    acc, gyr = (whole.numbers(first_triple(whole.columns, of)) if whole else np.zeros((0, 3)) for of in (ACC, GYR))
    complete = np.isfinite(np.hstack([acc, gyr])).all(axis=1)
    return bool(complete.any()) and likely_rate_hz(acc[complete], gyr[complete], "") is not None


def _read_text(path: Path) -> str:
    with reading(path):
        check_size(path, MEMORY_PER_TEXT * path.stat().st_size)
        return decode_text(path.read_bytes(), path.name)


def load_table(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a table of text.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; the message names what is missing.
    """
    return table_of_text(_read_text(path), path, hints)


def is_table_of_sensors(text: str, name: str) -> bool:
    """Return True if a text names the columns of an accelerometer and a gyroscope."""
    table = find_named_table(text, name)
    return table is not None and names_both(table.columns)


def table_of_text(text: str, path: Path, hints: Hints) -> Recording:
    """Return the recording in the text of a table; see load_table."""
    if not text.strip():
        raise RecordingError(f"{path} is empty", "record it again")
    table = find_any_table(text, path.name, [*hints.columns.values()], hints.sensor)
    if table is None:
        raise RecordingError(
            f"{path.name} names no columns of an accelerometer and a gyroscope in its first {PREAMBLE} lines",
            "name them with --columns t=NAME,ax=NAME,... or --columns t,ax,ay,az,gx,gy,gz, and --units",
        )
    if not len(table):
        raise RecordingError(f"{path.name} holds no lines below the names of its columns", "record it again")
    units = next((units for words, units in PROGRAMS.items() if words in text[:HEAD]), {})
    return recording_from_table(replace(table, rate_hz=stated_rate_hz(text[:HEAD]), units=units), hints)


def find_any_table(text: str, name: str, wanted: Sequence[str | int] = (), sensor: str | None = None) -> Table | None:
    """Return the table of the `wanted` columns, or of named ones, or else of numbers; of one `sensor` if of several."""
    if wanted:
        return find_wanted_table(text, name, wanted)
    return of_one_beginning(text, name, sensor, _find_table) or _find_table(text, name)


def _find_table(text: str, name: str) -> Table | None:
    for find in (marked_table, dataflash_text_table, labelled_table, find_named_table):
        if (found := find(text, name)) is not None:
            return found
    found = find_bare_table(text, name)
    return found and (pivot(found) or with_sensor_of_file(found))


def with_sensor_of_file(table: Table) -> Table:
    """Return a table of one sensor, whose columns are x, y, z, or [time and] three without names, under its name.

    The sensor is that of their unit, or of the file's name.

    Raises
    ------
    RecordingError : it is Sensor Logger's table of accelerations without gravity.
    """
    header, of_file = table.header, names.axes_of(Path(table.name).stem)
    if OF_SENSOR_LOGGER in header and Path(table.name).stem.lower() == LINEAR:
        raise RecordingError(
            f"{table.name} is of Sensor Logger, which writes accelerations without gravity into that table",
            "record its Total Acceleration or the uncalibrated accelerometer, and give the folder",
        )
    axes = [names.parse_axis_name(name) for name in header]
    if not header and len(table) and STAMP(",".join(cells[0] for cells in table.cells)):
        header = ["stamp.sec", "stamp.nanosec", *[""] * (len(table.cells) - 2)]
    elif any(axes):
        units = {axis[1] for axis in axes if axis}
        shown = [of for of in (ACC, GYR) if units & set(QUANTITIES[of])] + [axis[:-1] for axis in of_file[:1]]
        header = names.with_sensor(header, shown[0]) if shown else header
    elif of_file and len(places := table.places(Kind.NUMBER)) in (3, 4) and not table.of_sensors:
        first, last = table.numbers([Column("", places[at], "") for at in (0, -1)]).T
        order = [*of_file, "time"] if len(places) == 4 and is_clock(last) > is_clock(first) else ["time", *of_file]
        called = dict(zip(places, order[-len(places) :], strict=True))
        header = [called.get(at, table.name_of(at)) for at in range(len(table.cells))]
    return replace(table, header=header)


def recording_from_table(table: Table, hints: Hints) -> Recording:
    """Return the recording in a table that holds both sensors.

    Raises
    ------
    RecordingError : it does not say all that is needed; the message names what is missing.
    """
    table = _oldest_first(table if table.of_sensors or hints.columns else with_sensor_of_file(table))
    if not table.chosen:
        table = of_one_sensor(table if hints.columns else of_one_place(table, hints.sensor), hints.sensor)
    ranges = table.ranges if not (hints.accel_range_g or hints.gyro_range_dps) else None
    if ranges:
        hints = replace(hints, accel_range_g=ranges[0], gyro_range_dps=ranges[1])
    columns, guess_remark = find_columns(table, hints)
    table = of_one_turn(table, first_triple(columns, ACC), hints.sensor)
    accelerometers, gyroscopes = names.axis_triples(columns, ACC), names.axis_triples(columns, GYR)
    warm = [column for column in columns if column.quantity == names.TEMPERATURE]
    # a rate beside columns without a time says that the times are wrong
    at = () if hints.columns and hints.rate_hz and "t" not in hints.columns else table.clocks(columns)
    streams = [sensor_stream(table, at, of, warm) for of in accelerometers]
    chosen = index_with_gravity(streams)
    # several sensors under one name have a gyroscope each
    each = len({column.name for of in accelerometers for column in of}) == len("xyz")
    gyr = gyroscopes[chosen] if each and chosen < len(gyroscopes) else first_triple(columns, GYR)
    acc, a, w = accelerometers[chosen], streams[chosen], sensor_stream(table, at, gyr) if gyr else None
    a, ios_remark = _undo_ios_sign(a, acc[0].name.strip().lower())
    several = len(accelerometers) > 1
    remarks = [
        f"the accelerometer is {', '.join(column.name.strip() for column in acc)}" if several else "",
        FLIPPED if acc[0].stem in names.FLIPPED_STEMS else ios_remark,
        *table.remarks,
        "the ranges are those that MPU6050::initialize() sets" if ranges else "",
        guess_remark,
        "" if hints.columns or table.chosen else names.ignored_sensors(table.header, columns),
        "accelerations are increments over a sample, by their own times" if interval_column(table, acc[0]) else "",
        *(f"its column {c.name.strip()} was not read as the time" for c in at[:1] if a.ticks is None),
    ]
    return join_streams(a, w, hints, table.name, remarks)


def _oldest_first(table: Table) -> Table:
    """Return a table whose lines are the newest first, as databases export them, in the order of their times."""
    if len(table) < FEWEST:
        return table
    # the part of the file that was read may end within a line
    some = np.isin(np.arange(len(table)), np.linspace(0, len(table) - 2, LOOKED_AT).astype(int))
    # damaged times are reported where all are read
    with suppress(RecordingError):
        clocks, whole = table.clocks(table.columns), np.ones(len(table), bool)
        steps = [np.diff(table.part(some).times(clock, whole[some])[0]) for clock in clocks]
        fall = [clock for clock, of in zip(clocks, steps, strict=True) if (of <= 0.0).all() and of.any()]
        rises = any((of >= 0.0).all() and of.any() for of in steps)
        # a temperature that falls stays for many lines
        sure = (not is_weak(clock) or (np.diff(table.times(clock, whole)[0]) < 0.0).all() for clock in fall)
        if not rises and any(sure):
            remark = "its lines are the newest first, and were read from the last to the first"
            cells = [of[::-1] for of in table.cells]
            return table.noted(remark, cells=cells, lines=table.lines[::-1])
    return table


def _undo_ios_sign(stream: Stream, name: str) -> tuple[Stream, str]:
    """Return the accelerations of Sensor Logger's one table with Android's sign, and a remark on it."""
    if name.startswith(IN_G_ON_IOS) and acceleration_unit(stream.values[stream.complete]) == "g":
        return replace(stream, values=-stream.values), FLIPPED
    unknown = "the sign of the accelerations was kept; if an iPhone recorded them, it is the opposite one, also of b_a"
    return stream, unknown if name.startswith(EITHER_SIGN) else ""
