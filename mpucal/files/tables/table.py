"""A table of another program as a recording, and the part that text and arrays share."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...data import Recording, Vector
from ...errors import RecordingError
from ..csv import COLUMNS
from ..hints import NO_HINTS, ROLES, Hints
from ..reading import HELD, MOST_ODD, check_size, first_bytes, reading
from .array_table import stated_rate_hz
from .clock import FEWEST
from .guess import guess_columns, is_clock, is_even_clock
from .labelled import labelled_table, marked_table
from .names import (
    ACC,
    BY_A_WORD,
    GYR,
    NANOSECONDS,
    TEMPERATURE,
    TIME,
    Column,
    Table,
    axes_of,
    axis_triples,
    first_triple,
    ignored_sensors,
    parse_axis_name,
    parse_column_name,
    plausible_celsius,
    with_sensor,
)
from .streams import index_with_gravity, join_streams, mean_acceleration_unit
from .text import HEAD, PREAMBLE, TextTable, decode_text, find_numbers, find_numeric_table, find_table
from .times import Stream
from .units import BEYOND, QUANTITIES, acceleration_unit, are_counts, seem_counts

# words of a program's preamble -> units that its names of columns do not say
PROGRAMS = {"MT Manager version": {"acc": "m/s^2", "gyr": "rad/s"}}
# seconds since 1970, and nanoseconds
STAMP = re.compile(r"(?<![^,])[12]\d{9},\d{1,9}(?![^,])")
NAMED_BY_ORDER = f"--columns {','.join(ROLES)}"
FLIPPED = "accelerations have the opposite sign, as on iOS, and were negated"
# accelerations from which a program has taken gravity
WITHOUT_GRAVITY = re.compile(r"\s*(?:free|user|linear)[ _]?acc(?!.*covariance)", re.IGNORECASE)
# columns of a table with a line for each number
FIELD, VALUE = "field", "value"
# stems of Sensor Logger's one table: the first is in g on iOS; the second does not tell iOS from Android
IN_G_ON_IOS, EITHER_SIGN = "accelerometeruncalibrated_", "totalacceleration_"


def is_table(path: Path) -> bool:
    """Return True if a file begins as a table of a sensor."""
    return _begun(path) is not None


def is_own_table(path: Path) -> bool:
    """Return True if a file begins as a table in mpucal's own format and units."""
    table = _begun(path)
    named = {name.strip().lower() for name in table.header} if table else set()
    return table is not None and table.separator == "," and set(COLUMNS) <= named and _may_be_si(table)


def _begun(path: Path) -> TextTable | None:
    try:
        return find_any_table(decode_text(first_bytes(path), path.name), path.name)
    except RecordingError:
        return None


def find_any_table(text: str, name: str, wanted: Sequence[str | int] = ()) -> TextTable | None:
    """Return the table of the `wanted` columns, or of named ones, or else of numbers; see find_table."""
    if wanted:
        return find_table(text, name, wanted) or find_numbers(text, name)
    found = marked_table(text, name) or labelled_table(text, name) or find_table(text, name)
    if found:
        return found
    found = find_table(text, name, bare=True) or find_numeric_table(text, name, 3) or find_numbers(text, name)
    return None if found is None else replace(found, header=_with_sensor(found))


def _with_sensor(table: TextTable) -> list[str]:
    """Return the header of one sensor's table: of columns x, y, z, or of [time and] three without names; or its own.

    The sensor is that of their unit, or of the file's name.
    """
    axes = [parse_axis_name(name) for name in table.header]
    if not table.header and (stamp := STAMP.search(",".join(table.rows[0]))):
        # `ros2 topic echo --csv`
        place = stamp.string.count(",", 0, stamp.start())
        return [{place: "stamp.sec", place + 1: "stamp.nanosec"}.get(at, "") for at in range(len(table.rows[0]))]
    of_file = axes_of(Path(table.name).stem)
    if not any(axes):
        places = table.numeric_places()
        names = ["time", *of_file][4 - len(places) :] if len(places) in (3, 4) and of_file and not table.header else []
        found = dict(zip(places, names, strict=False))
        return [found.get(at, "") for at in range(len(table.rows[0]))] if found else table.header
    units = {axis[1] for axis in axes if axis}
    of = next((of for of in (ACC, GYR) if units & set(QUANTITIES[of])), of_file[0].removesuffix("x") if of_file else "")
    return with_sensor(table.header, of) if of else table.header


def _may_be_si(table: TextTable) -> bool:
    """Return True unless the accelerations show a unit other than m/s^2."""
    values = table.numbers(first_triple(table.columns, ACC))
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < FEWEST:
        return True
    return not seem_counts(values) and acceleration_unit(values) in ("", "m/s^2")


def load_table(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a table of text.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; the message names what is missing.
    """
    with reading(path):
        check_size(path, HELD * path.stat().st_size)
        text = decode_text(path.read_bytes(), path.name)
    table = find_any_table(text, path.name, [*hints.columns.values()])
    if not text.strip():
        raise RecordingError(f"{path} is empty", "record it again")
    if table is None:
        raise RecordingError(
            f"{path.name} names no columns of an accelerometer and a gyroscope in its first {PREAMBLE} lines",
            "name them with --columns t=NAME,ax=NAME,... or --columns t,ax,ay,az,gx,gy,gz, and --units",
        )
    if not table.rows:
        raise RecordingError(f"{path.name} holds no lines below the names of its columns", "record it again")
    known = next((units for words, units in PROGRAMS.items() if words in text[:HEAD]), {})
    table = replace(table, rate_hz=stated_rate_hz(text[:HEAD]))
    hints = replace(hints, units={**known, **hints.units})
    if table.ranges and not (hints.accel_range_g or hints.gyro_range_dps):
        hints = replace(hints, accel_range_g=table.ranges[0], gyro_range_dps=table.ranges[1])
    return recording_from_table(table, hints)


def recording_from_table(table: Table, hints: Hints) -> Recording:
    """Return the recording in a table that holds both sensors.

    Raises
    ------
    RecordingError : it does not say all that is needed; the message names what is missing.
    """
    columns, guess_remark = columns_by_hint(table.header, hints) if hints.columns else table.columns, ""
    if not hints.columns:
        columns, guess_remark = _guess(table, columns, hints)
    accelerometers, gyr = axis_triples(columns, ACC), first_triple(columns, GYR)
    if not accelerometers:
        raise _missing_sensors(table, columns)
    warm = [column for column in columns if column.quantity == TEMPERATURE]
    # a rate beside columns without a time says that the times are wrong
    at = () if hints.columns and hints.rate_hz and "t" not in hints.columns else table.clocks(columns)
    streams = [sensor_stream(table, at, of, warm) for of in accelerometers]
    chosen = index_with_gravity(streams)
    acc, a, w = accelerometers[chosen], streams[chosen], sensor_stream(table, at, gyr) if gyr else None
    a, ios_remarks = _undo_ios_sign(a, acc)
    several = len(accelerometers) > 1
    remarks = [
        f"the accelerometer is {', '.join(column.name.strip() for column in acc)}" if several else "",
        FLIPPED if acc[0].sign_flipped else "",
        *ios_remarks,
        *table.remarks,
        guess_remark,
        "" if hints.columns else ignored_sensors(table.header, columns),
    ]
    return join_streams(a, w, hints, table.name, remarks)


def _guess(table: Table, columns: list[Column], hints: Hints) -> tuple[list[Column], str]:
    """Return the columns with those that only physics shows, and a remark on them; see guess_columns."""
    known = bool(first_triple(columns, ACC) and first_triple(columns, GYR))
    hints = replace(hints, rate_hz=hints.rate_hz or table.rate_hz)
    if known and (table.clocks(columns) or hints.rate_hz):
        return columns, ""
    of = _numbers(table)
    even = [place for place in of if is_even_clock(of[place])]
    if known:
        clocks = [Column(table.header[place], place, TIME) for place in even[:1]]
        return [*columns, *clocks], "".join(f"{clock.name.strip()} is taken for the time" for clock in clocks)
    places = list(of)
    found = (
        {role: places[at] for role, at in guess_columns(np.column_stack([*of.values()]), hints).items()} if of else {}
    )
    if not found:
        return columns, ""
    found = dict(zip("t", even, strict=False)) | found
    order = {place: role for role, place in found.items()}
    order |= {clock.place: "t" for clock in table.clocks(columns)[:1] if "t" not in found}
    words = ",".join(order.get(place, "-") for place in range(max(order) + 1))
    named = (TEMPERATURE, TIME, NANOSECONDS) if table.clocks(columns) else (TEMPERATURE,)
    kept = [c for c in columns if c.quantity in named]
    found = {role: place for role, place in found.items() if role != "t" or TIME not in named}
    by = "how gravity turns" if "gx" in found else "the length of gravity"
    remark = f"its columns were guessed from {by}: --columns {words}"
    return [*columns_by_hint(table.header, replace(hints, columns=found)), *kept], remark


def _missing_sensors(table: Table, columns: list[Column]) -> RecordingError:
    if without := [name.strip() for name in table.header if WITHOUT_GRAVITY.match(name)]:
        return RecordingError(
            f"{table.name} holds accelerations without gravity ({', '.join(without)}), and no others",
            "export the accelerometer's own values and the rates of the gyroscope",
        )
    if first_triple(columns, GYR):
        return RecordingError(
            f"{table.name} holds no columns of an accelerometer; its columns are {_list_names(table.header)}",
            "give the folder with the tables of both, or name them with --columns t=NAME,ax=NAME,...",
        )
    if {FIELD, VALUE} <= {name.strip(" _").lower() for name in table.header}:
        return RecordingError(
            f"{table.name} holds one number on each line",
            'export a column for each axis, as by InfluxDB\'s pivot(rowKey: ["_time"], columnKey: ["_field"],'
            ' valueColumn: "_value")',
        )
    options = _likely_options(table, columns)
    if options is None:
        return RecordingError(
            f"{table.name} holds no three columns as long as gravity; its columns are {_list_names(table.header)}",
            "export the accelerometer's own values and the rates of the gyroscope",
        )
    return RecordingError(
        f"{table.name} holds no columns that are known by their names or by how gravity turns; its columns are"
        f" {_list_names(table.header)}",
        f"name its columns in their order with {options or NAMED_BY_ORDER}, and - for one to leave out",
        options,
    )


def _likely_options(table: Table, columns: list[Column]) -> str | None:
    """Return options if triples of the columns are the sensors'; empty if they are too few, None without gravity."""
    of = _numbers(table)
    increasing = [place for place in of if is_clock(of[place])]
    clocks = [c.place for c in table.clocks(columns)] or [place for place in increasing if is_even_clock(of[place])]
    sensors = [place for place in of if place not in {*clocks, *increasing}]
    triples = [sensors[first : first + 3] for first in range(0, len(sensors) - 2, 3)]
    values = [np.column_stack([of[place] for place in triple]) for triple in triples]
    if not triples:
        return ""
    acc = next((i for i, each in enumerate(values) if are_counts(each) or mean_acceleration_unit(each)), None)
    if acc is None:
        return None
    # rates are none at times, other than a magnetic field
    others = sorted((i for i in range(len(triples)) if i != acc), key=lambda i: _steadiness(values[i]))
    found = [place for i in (acc, *others[:1]) for place in triples[i]]
    roles = dict(zip(found, ROLES[1:], strict=False)) | dict(zip(clocks[:1], "t", strict=False))
    order = ",".join(roles.get(place, "-") for place in range(max(roles) + 1))
    unit = "" if are_counts(values[acc]) or acceleration_unit(values[acc]) else mean_acceleration_unit(values[acc])
    return f"--columns {order}" + (f" --units acc={unit}" if unit else "")


def _numbers(table: Table) -> dict[int, Vector]:
    """Return place -> (n,) of the columns of numbers in whole lines."""
    places = table.numeric_places()
    with suppress(RecordingError):
        numbers = table.numbers([Column("", place, "") for place in places])
        whole = (np.abs(numbers) < BEYOND**2).all(axis=1)
        return dict(zip(places, numbers[whole].T, strict=True)) if whole.any() else {}
    return {}


def _steadiness(values: Vector) -> float:
    """Return the first quartile of the lengths of (n, 3) over their median."""
    low, size = np.percentile(np.linalg.norm(values, axis=1), [25, 50]).tolist()
    return low / size if size else 0.0


def _list_names(header: Sequence[str]) -> str:
    return ", ".join(name.strip() for name in header if name.strip()) or "unnamed"


def _undo_ios_sign(stream: Stream, acc: Sequence[Column]) -> tuple[Stream, list[str]]:
    """Return the accelerations of Sensor Logger's one table with Android's sign, and remarks on it."""
    name = acc[0].name.strip().lower()
    if name.startswith(IN_G_ON_IOS) and acceleration_unit(stream.values[stream.complete]) == "g":
        return replace(stream, values=-stream.values), [FLIPPED]
    unknown = "the sign of the accelerations was kept; if an iPhone recorded them, it is the opposite one, also of b_a"
    return stream, [unknown] if name.startswith(EITHER_SIGN) else []


def sensor_stream(
    table: Table, clocks: Sequence[Column], axes: Sequence[Column], warm: Sequence[Column] = ()
) -> Stream:
    """Return the samples in one sensor's three columns, and the temperatures beside them; see Stream.

    Many lines without any number are those of another sensor.
    """
    values = table.numbers(axes)
    values = -values if axes[0].sign_flipped else values
    values[~np.isfinite(values)] = np.nan
    empty = np.isnan(values).all(axis=1)
    clocks = [c for c in clocks if c.clock_of in ("", axes[0].quantity) and _passes(table, c)]
    clock = min(clocks, key=lambda c: (not c.clock_of, c.rank, c.rank == BY_A_WORD and not c.unit), default=None)
    others = np.count_nonzero(empty) > MOST_ODD * len(values)
    timed = np.ones(len(values), bool) if clock is None else table.has(clock)
    kept = np.asarray(~empty if others else ~empty | timed)
    unit = axes[0].unit if len({column.unit for column in axes}) == 1 else ""
    times, time_unit = (None, "") if clock is None else table.times(clock, kept)
    if clock is not None and clock.rank == BY_A_WORD and not is_clock(np.array(times, float)):
        times = None
    return Stream(
        times,
        values[kept],
        time_unit,
        unit,
        places=None if others and clock else np.flatnonzero(kept),
        temperature_c=plausible_celsius(table.numbers(warm[:1])[kept, 0]) if warm else None,
        lost=0 if others else int((~kept).sum()),
        rate_hz=table.rate_hz,
    )


def _passes(table: Table, clock: Column) -> bool:
    """Return False for a column called t that does not increase, such as a temperature."""
    if clock.name.strip().lower() != "t":
        return True
    steps = np.diff(np.array(table.times(clock, table.has(clock))[0], float))
    return bool((steps > 0).any() and np.count_nonzero(steps < 0) * FEWEST <= len(steps))


def columns_by_hint(header: Sequence[str], hints: Hints) -> list[Column]:
    """Return the columns that the user names.

    Raises
    ------
    RecordingError : the table has no such column.
    """
    named = {name.strip(): place for place, name in enumerate(header)}
    without_unit = {name.partition("(")[0].strip(): place for name, place in named.items()}
    found = []
    for role, where in hints.columns.items():
        place = where if isinstance(where, int) else named.get(where, without_unit.get(where, -1))
        if place < 0 or (header and place >= len(header)):
            raise RecordingError(
                f"there is no column {where + 1 if isinstance(where, int) else where} for {role}",
                f"name one of {', '.join(named) or 'its columns by their number from 1'} with --columns",
            )
        name = header[place] if header else role
        known = parse_column_name(name, place)
        quantity = TIME if role == "t" else ACC if role[0] == "a" else GYR
        unit = known.unit if known and known.quantity == quantity else ""
        found.append(Column(name, place, quantity, "xyz".find(role[-1]) if role != "t" else 0, unit))
    return found
