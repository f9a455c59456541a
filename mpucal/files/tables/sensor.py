"""The columns of one sensor in a table as a stream: which lines are its samples, and which column holds their times."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal

import numpy as np

from ...data import Mask, Vector
from ..reading import MOST_ODD
from . import names
from .guess import increases, is_index
from .names import TIME, Column
from .shown_units import time_unit
from .table import Table, are_many
from .times import Stream
from .units import OF_BNO055, QUANTITIES


def sensor_stream(
    table: Table, clocks: Sequence[Column], axes: Sequence[Column], warm: Sequence[Column] = ()
) -> Stream:
    """Return the samples in one sensor's three columns, and the temperatures beside them; see Stream.

    Lines without any number are those of another sensor if they are many, or hold cells that the others lack.
    """
    values = table.numbers(axes)
    values = -values if axes[0].stem in names.FLIPPED_STEMS else values
    interval = interval_column(table, axes[0])
    if interval is not None:
        dt = table.numbers([interval])
        values = values / np.where(dt > 0.0, dt * QUANTITIES[TIME][interval.unit], np.nan)
    values[~np.isfinite(values)] = np.nan
    empty = np.asarray(np.isnan(values).all(axis=1))
    others = int(np.count_nonzero(empty)) > MOST_ODD * len(values) or _are_of_others(table, empty)
    units = {column.unit for column in axes}
    kept, timed, steps = np.asarray(~empty | (not others)), None, None
    of_sensor = [clock for clock in clocks if names.SENSOR_CLOCKS.get(clock.stem, axes[0].quantity) == axes[0].quantity]
    of_sensor.sort(key=lambda c: (c.stem not in names.SENSOR_CLOCKS, c.rank, c.rank == names.BY_A_WORD and not c.unit))
    for clock in of_sensor:
        has = kept if others else ~empty | table.has(clock)
        found = table.times(clock, has)
        steps = _intervals(found[0], float(found[1]), clock)
        if steps is not None:
            found = np.cumsum(steps), Decimal(0), found[2]
        is_time = increases(found[0]) if is_weak(clock) else True
        # the numbers of samples are no times
        if is_time and (found[2] or not is_index(found[0])):
            kept, timed = has, found
            break
    ticks, origin, time_unit = timed or (None, Decimal(0), "")
    return Stream(
        ticks,
        values[kept],
        origin,
        time_unit,
        (units.pop() if len(units) == 1 else "") or table.units.get(axes[0].quantity, ""),
        places=None if others and timed else np.flatnonzero(kept),
        temperature_c=names.plausible_celsius(table.numbers(warm[:1])[kept, 0]) if warm else None,
        lost=0 if others else int((~kept).sum()),
        rate_hz=table.rate_hz,
        # xacc and xgyro of MAVLink are in mg and mrad/s
        whole_unit="" if axes[0].name.strip().lower().startswith("x") else OF_BNO055[axes[0].quantity],
        of_increments=axes[0].stem in names.INCREMENTS and interval is None,
        summed=steps is not None and timed is not None,
    )


def interval_column(table: Table, axis: Column) -> Column | None:
    """Return the column of the times that a sensor's increments are of, as PX4 and ArduPilot write it; None if none is.

    It is called after them (delta_angle_dt beside delta_angle[0], DelaT beside DelAX), and its size shows its unit.
    """
    plain = [re.sub(r"[\W_]", "", name.lower()) for name in (axis.name, *table.header)]
    place = next((plain.index(of) - 1 for of in (f"{plain[0][:-1]}dt", f"{plain[0][:-1]}t") if of in plain), None)
    if place is None or axis.stem not in names.INCREMENTS:
        return None
    column = Column(table.header[place], place, TIME)
    known = table.numbers([column])
    unit = time_unit(float(np.median(known[np.isfinite(known)]))) if np.isfinite(known).any() else ""
    return replace(column, unit=unit) if unit else None


def _are_of_others(table: Table, empty: Mask) -> bool:
    """Return True if there is a column that holds cells only in lines where this sensor has none."""
    has = (table.has(Column("", at, "")) for at in range(len(table.cells)))
    some = 0 < int(np.count_nonzero(empty)) < len(empty)
    return some and any(bool(of[empty].mean() > 0.5 > of[~empty].mean()) for of in has)


def _intervals(since: Vector, first: float, clock: Column) -> Vector | None:
    """Return the steps (n,) between samples if a column holds these; None if it holds times.

    The column is called after steps, and its numbers, given as times since the `first`, do not grow. A damaged step is
    replaced by the usual one.
    """
    if clock.stem not in names.INTERVALS.split() or not len(since) or not np.isfinite(first):
        return None
    steps = since + first
    usual, bad = float(np.nanmedian(steps)), ~(steps > 0.0)
    grow = not are_many(int(np.count_nonzero(~(np.diff(steps) > 0.0))), steps)
    return None if grow or are_many(int(bad.sum()), steps) else np.where(bad, usual, steps)


def is_weak(clock: Column) -> bool:
    """Return True for a column that may be no clock: `t` may be a temperature."""
    return clock.rank == names.BY_A_WORD or (clock.rank != names.CHOSEN and clock.name.strip().lower() in ("t", "ts"))
