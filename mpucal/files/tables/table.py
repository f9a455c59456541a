"""A table of another program as a recording: both sensors in one table, or in one each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...data import Mask, Recording, Vector
from ...errors import RecordingError
from ..budget import HELD, LONGEST_LINE, afford
from ..csv import COLUMNS
from ..hints import NO_HINTS, ROLES, Hints
from ..rows import cannot_read
from .clock import FEWEST
from .guess import guessed
from .labelled import labelled_table
from .names import (
    ACC,
    GYR,
    NANOSECONDS,
    TEMPERATURE,
    TIME,
    Column,
    celsius,
    columns_of,
    three,
    threes,
)
from .streams import are_counts, recording_of, with_gravity
from .text import NS, PREAMBLE, SEPARATORS, TextTable, numeric_table, table_of, text_of
from .times import Stream
from .units import acceleration_unit, likely_rates, signed

SNIFFED = 1 << 16
# of both sensors
FEWEST_COLUMNS = 6
# of all lines, those without a number: more are another sensor's
ANOTHERS = 0.1
# words of a program's preamble -> units that its names of columns do not say
PROGRAMS = {"MT Manager version": {"acc": "m/s^2", "gyr": "rad/s"}}
PREAMBLE_CHARACTERS = 4096
# m/s^2: whole numbers that are larger are counts
LARGEST_OF_SI = 300.0
# of Sensor Logger's one table: what has another unit on iOS, and what does not say whose sign it has
IN_G_ON_IOS, UNTOLD = "accelerometeruncalibrated_", "totalacceleration_"
OTHER_SIGN = "accelerations with the other sign, as iOS has them"


def is_table(path: Path) -> bool:
    """Whether a file begins as a table of both sensors that is not mpucal's own."""
    try:
        with path.open("rb") as file:
            table = _table(text_of(file.read(SNIFFED), path.name), path.name)
        return table is not None and not (_is_own(path) and _may_be_si(table))
    except (OSError, RecordingError):
        return False


def _table(text: str, name: str) -> TextTable | None:
    return _named(text, name) or numeric_table(text, name, FEWEST_COLUMNS)


def _named(text: str, name: str) -> TextTable | None:
    return labelled_table(text, name) or table_of(text, name)


def _may_be_si(table: TextTable) -> bool:
    """Whether the accelerations show no other unit than m/s^2."""
    values = table.numbers(three(table.columns, ACC))
    values = values[whole(values)[0]]
    if len(values) < FEWEST:
        return True
    counts = are_counts(values) and float(np.median(np.abs(values).max(axis=1))) > LARGEST_OF_SI
    return not counts and acceleration_unit(values) in ("", "m/s^2")


def _is_own(path: Path) -> bool:
    with path.open("rb") as file:
        first = file.readline(LONGEST_LINE).decode("utf-8-sig", "replace").lower().partition("\r")[0]
    return set(COLUMNS) <= {cell.strip().strip('"') for cell in first.split(",")}


def load_table(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """The recording in a table.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; what is missing is named.
    """
    try:
        afford(path, HELD * path.stat().st_size)
        data = path.read_bytes()
    except OSError as error:
        raise cannot_read(path, error) from error
    text = text_of(data, path.name)
    table = table_of(text, path.name, list(hints.columns.values())) if hints.columns else _named(text, path.name)
    if table is None and (unnamed := numeric_table(text, path.name, FEWEST_COLUMNS)) is not None:
        return _of_unnamed(unnamed, hints)
    if table is not None and not table.rows:
        raise RecordingError(f"{path.name} holds no lines below the names of its columns", "record it again")
    hints = _known(text, hints)
    if table is None:
        raise RecordingError(
            f"{path.name} names no columns of an accelerometer and a gyroscope in its first {PREAMBLE} lines",
            "name them with --columns t=NAME,ax=NAME,... or --columns t,ax,ay,az,gx,gy,gz, and --units",
        )
    return recording_of_table(table, hints)


def _known(text: str, hints: Hints) -> Hints:
    """The hints, and what is known of the units of a program that names itself before its table."""
    units = next((units for words, units in PROGRAMS.items() if words in text[:PREAMBLE_CHARACTERS]), {})
    return replace(hints, units={**units, **hints.units})


def _of_unnamed(table: TextTable, hints: Hints) -> Recording:
    """The recording in a table without names, where physics says which column is what."""
    width = len(table.rows[0])
    order, said = _guessed(table, hints)
    if not order:
        raise RecordingError(
            f"{table.name} holds no columns that are known by their names or by how gravity turns; they are"
            f" {_listed(table.header)}",
            f"name its {width} columns in their order with --columns {','.join(ROLES)}, and - for one to leave out",
            f"--columns {','.join(ROLES)}",
        )
    made = recording_of_table(table, replace(hints, columns=order))
    return replace(made, taken=f"{(made.taken or '').removesuffix('.')}; {said}.")


def _guessed(table: TextTable, hints: Hints) -> tuple[dict[str, str | int], str]:
    """Role -> place of its columns of numbers, by physics; see guessed."""
    width = min(map(len, table.rows))
    places = [place for place in range(width) if table.has(Column("", place, ""))]
    try:
        order, said = guessed(table.numbers([Column("", place, "") for place in places]), hints)
    except RecordingError:
        return {}, ""
    return {role: places[place] for role, place in order.items()}, said


def recording_of_table(table: TextTable, hints: Hints) -> Recording:
    """The recording in a table that holds both sensors."""
    columns = chosen(table.header, hints) if hints.columns else table.columns
    all_acc, gyr = threes(columns, ACC), three(columns, GYR)
    if not (all_acc and gyr) and not hints.columns and _guessed(table, hints)[0]:
        return _of_unnamed(table, hints)
    if not all_acc or not gyr:
        lacks = "a gyroscope" if all_acc else "an accelerometer"
        raise RecordingError(
            f"{table.name} holds no columns of {lacks}; its columns are {_listed(table.header)}",
            "give the folder with the tables of both, or name them with --columns t=NAME,ax=NAME,...",
        )
    warm = [column for column in columns if column.quantity == TEMPERATURE]
    accelerometers = [stream_of(table, columns, of) for of in all_acc]
    place = with_gravity(accelerometers)
    acc, a, w = all_acc[place], accelerometers[place], stream_of(table, columns, gyr)
    temperature_c = celsius(table.numbers(warm[:1])[a.there, 0]) if warm else None
    called = SEPARATORS.get(table.separator, "names")
    separated = [] if table.separator == "," else [f"its cells are separated by {called}"]
    if w.times is None and hints.rate_hz is None:
        raise RecordingError(
            f"{table.name} holds no times that are known as such; its columns are {_listed(table.header)}"
            f"{likely_rates(signed(a.values), signed(w.values), w.unit)}",
            "name them with --columns t=NAME,ax=NAME,... and --units t=UNIT, or"
            " give the rate of its samples with --rate HZ",
            "--rate HZ",
        )
    lost = [f"{len(table.lost)} lines that lack a number were left out"] if table.lost else []
    a, of_ios = as_of_ios(a, acc)
    said = [*remarks(columns, acc), *of_ios, *separated, *lost]
    recording = recording_of(a, w, hints, table.name, temperature_c, said)
    if not lost or hints.rate_hz is None or w.times is not None:
        # with times of their own, these show it
        return recording
    at = np.rint(recording.t * hints.rate_hz).astype(np.int64)
    return replace(recording, gap=recording.gap | table.after_lost[at])


def _listed(header: Sequence[str]) -> str:
    return ", ".join(name.strip() for name in header if name.strip()) or "unnamed"


def remarks(columns: list[Column], acc: Sequence[Column]) -> list[str]:
    """What is to be said of which columns were taken, and how."""
    several = len(threes(columns, ACC)) > 1
    of = [f"the accelerometer is {', '.join(column.name.strip() for column in acc)}"] if several else []
    return [*of, *([OTHER_SIGN] if acc[0].turned_around else [])]


def as_of_ios(stream: Stream, acc: Sequence[Column]) -> tuple[Stream, list[str]]:
    """The accelerations of Sensor Logger's one table with Android's sign, and what is to be said of it."""
    name = acc[0].name.strip().lower()
    if name.startswith(IN_G_ON_IOS) and acceleration_unit(stream.values) == "g":
        return replace(stream, values=-stream.values), [OTHER_SIGN]
    may_be = "the accelerations' sign was left as it is, which on iOS is the other one (b_a then has it, too)"
    return stream, [may_be] if name.startswith(UNTOLD) else []


def stream_of(table: TextTable, columns: Sequence[Column], of: Sequence[Column]) -> Stream:
    """What one sensor's columns hold, without the lines that lack one of them."""
    values = table.numbers(of)
    if of[0].turned_around:
        values = -values
    there, lost = whole(values)
    clocks = [c for c in columns if c.quantity == TIME and c.of in ("", of[0].quantity) and table.has(c)]
    clock = min(clocks, key=lambda c: (not c.of, c.rank), default=None)
    unit = of[0].unit if len({column.unit for column in of}) == 1 else ""
    if clock is None:
        return Stream(None, values[there], unit=unit, there=there, lost=lost)
    times, time_unit = table.times(clock), "ns" if table.is_dated(clock) else clock.unit
    if time_unit == "s" and (parts := [c for c in columns if c.quantity == NANOSECONDS]):
        times, time_unit = [s * NS + ns for s, ns in zip(times, table.times(parts[0]), strict=True)], "ns"
    kept = [time for time, is_there in zip(times, there, strict=True) if is_there]
    return Stream(kept, values[there], time_unit, unit, there=there, lost=lost)


def whole(values: Vector) -> tuple[Mask, int]:
    """(n,) whether a line of (n, 3) has its numbers, and how many were lost: not those of a line for another sensor."""
    there = np.asarray(np.isfinite(values).all(axis=1))
    empty = np.isnan(values).all(axis=1)
    others = int(empty.sum()) > ANOTHERS * len(values)
    return there, int((~there & ~empty).sum()) if others else int((~there).sum())


def chosen(header: Sequence[str], hints: Hints) -> list[Column]:
    """The columns that a person names.

    Raises
    ------
    RecordingError : the table has no such column.
    """
    named = {name.strip(): place for place, name in enumerate(header)}
    plain = {name.partition("(")[0].strip(): place for name, place in named.items()}
    found = []
    for role, where in hints.columns.items():
        place = where if isinstance(where, int) else named.get(where, plain.get(where, -1))
        if place < 0 or (header and place >= len(header)):
            raise RecordingError(
                f"there is no column {where + 1 if isinstance(where, int) else where} for {role}",
                f"name one of {', '.join(named) or 'its columns by their number from 1'} with --columns",
            )
        name = header[place] if header else role
        known = columns_of([name])
        quantity = TIME if role == "t" else ACC if role[0] == "a" else GYR
        unit = known[0].unit if known and known[0].quantity == quantity else ""
        found.append(Column(name, place, quantity, "xyz".find(role[-1]) if role != "t" else 0, unit))
    return found
