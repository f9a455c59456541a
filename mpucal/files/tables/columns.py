"""Choice of a table's columns: by the user's hints, by their names, or by physics; or the hints that would help."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ...data import Vector
from ...errors import RecordingError
from ..hints import ROLES, Hints
from . import names
from .cells import Kind
from .guess import MOST_COLUMNS, guess_columns, is_even_clock, likely_columns
from .names import ACC, GYR, TEMPERATURE, TIME, Column, first_triple, names_both
from .shown_units import LARGEST_NUMBER
from .table import Table

NAMED_BY_ORDER = f"--columns {','.join(ROLES)}"
OF_ARRAY = re.compile(r"(.*)\(\d+\)").fullmatch
_GIVE_VALUES = "export the accelerometer's own values and the rates of the gyroscope"


def find_columns(table: Table, hints: Hints) -> tuple[list[Column], str]:
    """Return the columns of a table that are read, and a remark on those that names do not show.

    Raises
    ------
    RecordingError : it has no column that the user names, or none of them is known to be an accelerometer.
    """
    columns, remark = table.columns, ""
    if hints.columns:
        chosen = columns_by_hint(table, hints.columns)
        taken = {column.place for column in chosen}
        warm = [c for c in columns if c.quantity == TEMPERATURE and c.place not in taken]
        return chosen + warm, remark
    named, clocks = names_both(columns), table.clocks(columns)
    hints = replace(hints, rate_hz=hints.rate_hz or table.rate_hz)
    if not (named and (clocks or hints.rate_hz)):
        of = measured(table)
        counts = [at for at in of if names.COUNTER.search(table.name_of(at)) and not np.any(of[at] % 1.0)]
        even = [at for at in of if is_even_clock(of[at]) and at not in counts]
        if named:
            columns = [*columns, *(Column(table.header[place], place, TIME) for place in even[:1])]
            remark = "".join(f"{table.name_of(place)} is taken for the time" for place in even[:1])
        elif found := guess_columns({at: of[at] for at in of if at not in counts}, hints):
            times = {} if clocks else dict(zip("t", even, strict=False))
            found = times | {role: place for role, place in found.items() if role != "t" or not clocks}
            order = _order(found | ({"t": clocks[0].place} if clocks else {}))
            by = "how gravity turns" if "gx" in found else "the length of gravity"
            kept = [c for c in columns if c.quantity == TEMPERATURE or (c.quantity == GYR and "gx" not in found)]
            columns = [*columns_by_hint(table, found), *clocks, *kept]
            remark = f"its columns were guessed from {by}: --columns {order}"
    if not first_triple(columns, ACC):
        raise _missing_sensors(table, columns)
    return columns, remark


def columns_by_hint(table: Table, roles: Mapping[str, str | int]) -> list[Column]:
    """Return the columns that the user names.

    Raises
    ------
    RecordingError : the table has no such column.
    """
    header, count = table.header, len(table.cells)
    named = {name.strip(): place for place, name in enumerate(header)}
    without_unit = {name.partition("(")[0].strip(): place for name, place in named.items()}
    found = []
    for role, where in roles.items():
        place = where if isinstance(where, int) else named.get(where, without_unit.get(where, -1))
        if not 0 <= place < count:
            raise RecordingError(
                f"there is no column {where + 1 if isinstance(where, int) else where} for {role}",
                f"name one of {', '.join(named) or f'its {count} columns by their number from 1'} with --columns",
            )
        name = header[place] if header else role
        known = names.parse_column_name(name, place)
        quantity = TIME if role == "t" else ACC if role[0] == "a" else GYR
        unit = known.unit if known and known.quantity == quantity else ""
        found.append(Column(name, place, quantity, "xyz".find(role[-1]) if role != "t" else 0, unit, names.CHOSEN))
    return found


def measured(table: Table) -> dict[int, Vector]:
    """Return place -> (n,) of the columns of numbers that a sensor may have measured, in whole lines."""
    places = _measured_places(table)
    with suppress(RecordingError):
        numbers = table.numbers([Column("", place, "") for place in places])
        whole = (np.abs(numbers) < LARGEST_NUMBER**2).all(axis=1)
        return dict(zip(places, numbers[whole].T, strict=True)) if whole.any() else {}
    return {}


def _measured_places(table: Table) -> list[int]:
    return [place for place in table.places(Kind.NUMBER) if not names.ESTIMATED.search(table.name_of(place))]


def _order(roles: Mapping[str, int]) -> str:
    """Return roles as text in the order of their columns, with `-` for others."""
    at = {place: role for role, place in roles.items()}
    return ",".join(at.get(place, "-") for place in range(max(at) + 1))


def _missing_sensors(table: Table, columns: Sequence[Column]) -> RecordingError:
    held = ", ".join(name.strip() for name in table.header if name.strip()) or "unnamed"
    if without := [name.strip() for name in table.header if names.WITHOUT_GRAVITY.match(name)]:
        what = f"{table.name} holds accelerations without gravity ({', '.join(without)}), and no others"
        return RecordingError(what, _GIVE_VALUES)
    if first_triple(columns, GYR):
        return RecordingError(
            f"{table.name} holds no columns of an accelerometer; its columns are {held}",
            "give the folder with the tables of both, or name them with --columns t=NAME,ax=NAME,...",
        )
    # name(1), name(2) and so on are of a matrix
    arrays = {place: found[1] for place, name in enumerate(table.header) if (found := OF_ARRAY(name))}
    of = measured(table)
    # among many columns with names of their own, three that are as long as gravity are so by chance
    named = sum(bool(table.name_of(place)) and place not in arrays for place in of) > MOST_COLUMNS
    likely = ({}, "") if named else likely_columns(of, [clock.place for clock in table.clocks(columns)], arrays)
    if likely is None or len(_measured_places(table)) < len("xyz"):
        what = f"{table.name} holds no three columns as long as gravity; its columns are {held}"
        return RecordingError(what, _GIVE_VALUES)
    roles, unit = likely
    if not roles:
        # a damaged line is named before an order that nothing shows
        table.numbers([Column("", place, "") for place in table.places(Kind.NUMBER)])
    options = f"--columns {_order(roles)}" + (f" --units acc={unit}" if unit else "") if roles else ""
    return RecordingError(
        f"{table.name} holds no columns that are known by their names or by how gravity turns; its columns are {held}",
        f"name its columns in their order with {options or NAMED_BY_ORDER}, and - for one to leave out",
        options,
    )
