"""Hints of the user on a recording that lacks the information: topic, sensor, columns, units, ranges and rate."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

from .tables.units import PER_SAMPLE, QUANTITIES, find_unit

ROLES = ("t", "ax", "ay", "az", "gx", "gy", "gz")
SKIPPED = ("-", "_", "")


@dataclass(frozen=True)
class Hints:
    """Hints on how to read a file; None or empty if not given.

    Attributes
    ----------
    topic : in a bag or a log with more than one IMU.
    sensor : of several in a table, what its lines or columns call it; or its number, where they take turns.
    columns : role (t, ax ... gz) -> a column's name, or its place from 0.
    units : quantity (t, acc, gyr) -> unit, as tables.units names it.
    accel_range_g, gyro_range_dps : full scale of counts. rate_hz : of samples without times.
    span : (from, to) in s since the first sample, the part to read; for any file.
    """

    topic: str | None = None
    sensor: str | None = None
    columns: Mapping[str, str | int] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    accel_range_g: float | None = None
    gyro_range_dps: float | None = None
    rate_hz: float | None = None
    span: tuple[float, float] | None = None

    @property
    def given(self) -> tuple[str, ...]:
        """Return the names of the hints that are given, except the span."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name) and f.name != "span")


NO_HINTS = Hints()


def parse_columns(text: str) -> Mapping[str, str | int]:
    """Parse `t=time_us,ax=AccX,...`, by name or number from 1, or `t,ax,ay,az,gx,gy,gz` in the order of the columns.

    Raises
    ------
    ValueError : it is neither.
    """
    items = [item.strip() for item in text.split(",")]
    found: dict[str, str | int] = {}
    for place, item in enumerate(items):
        role, equals, name = (word.strip() for word in item.partition("="))
        if not equals and role in SKIPPED:
            continue
        if role not in ROLES or role in found or (equals and not name):
            raise ValueError(
                f"{item!r} is not a column: give t=NAME,ax=NAME,... or the columns' order, such as t,ax,ay,az,gx,gy,gz"
            )
        found[role] = (int(name) - 1 if name.isdecimal() and int(name) else name) if equals else place
    return found


def parse_units(text: str) -> Mapping[str, str]:
    """Parse `t=ms,acc=g,gyr=deg/s`, or a part of it.

    Raises
    ------
    ValueError : another quantity or unit.
    """
    found = {}
    for item in text.split(","):
        quantity, _, unit = (word.strip() for word in item.partition("="))
        unit = find_unit(unit)
        if PER_SAMPLE.get(unit, unit) not in QUANTITIES.get(quantity, ()):
            known = "; ".join(f"{name} in {', '.join(units)}" for name, units in QUANTITIES.items())
            raise ValueError(f"{item!r} is not a unit: {known}")
        found[quantity] = unit
    return found


def parse_span(text: str) -> tuple[float, float]:
    """Parse `FROM:TO` in s since the first sample; an empty end is that of the recording.

    Raises
    ------
    ValueError : it is not a span.
    """
    begin, colon, end = text.partition(":")
    try:
        span = float(begin or 0.0), float(end or math.inf)
    except ValueError:
        span = 0.0, 0.0
    if not colon or not 0.0 <= span[0] < span[1]:
        raise ValueError(f"{text!r} is not a span: give FROM:TO in s since the first sample, such as 10:95, or :95")
    return span
