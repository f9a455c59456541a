"""A table of any file: columns of text, numbers or dates under their names, whose cells are parsed when asked for."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import cached_property
from itertools import chain, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...clocks import S
from ...clocks.stamps import FEWEST, SLOWEST_HZ, sample_period
from ...data import Mask, Vector
from ...errors import RecordingError
from .cells import DAY_NS, Cells, Kind, is_number, kind_of, parse_cell, since_first, since_midnight, with_point
from .names import ACC, COUNTS_OF_XSENS, GYR, NANOSECONDS, TIME, Column, axes_of, parse_header
from .units import QUANTITIES, find_unit

# units of a column beside whole seconds
BELOW_A_SECOND = ("ms", "us", "ns")
# a number and its unit in one cell
_WITH_UNIT = re.compile(r"[-+.\d][-+.,\deE]*( ?[^-+.,\d\s][^\d]{0,9}\d?)").fullmatch

# a list of JSON or of Python
IS_LIST = re.compile(r"\s*\[[^\[\]]*\]\s*").fullmatch


@dataclass(frozen=True)
class Table:
    """Columns of equally many cells.

    Attributes
    ----------
    name : of the file, for messages.
    header : the columns' names, of which some may be empty; empty if it has none.
    cells : of each column.
    lines : the line number of each row of a text.
    rate_hz : the sample rate, if the file states it.
    units : quantity -> unit of columns whose names have none, as the program writes them.
    ranges : g and deg/s, of counts, if the program sets them.
    remarks : notes to the user on how the table was read.
    chosen : True if its lines or columns were chosen among those of several sensors.
    """

    name: str
    header: list[str]
    cells: Sequence[Cells]
    lines: Sequence[int] = ()
    rate_hz: float | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    ranges: tuple[float, float] | None = None
    remarks: tuple[str, ...] = ()
    chosen: bool = False

    def __len__(self) -> int:
        return len(self.cells[0]) if self.cells else 0

    @cached_property
    def columns(self) -> list[Column]:
        """Return the columns whose names are known."""
        return parse_header(self.header)

    @property
    def of_sensors(self) -> list[Column]:
        """Return the columns that hold accelerations or rates, by their names."""
        return [column for column in self.columns if column.quantity in (ACC, GYR)]

    @cached_property
    def kinds(self) -> list[Kind]:
        """Return the kind of each column."""
        return [kind_of(cells) for cells in self.cells]

    def places(self, kind: Kind) -> list[int]:
        """Return the places of the columns of a kind."""
        return [place for place, of in enumerate(self.kinds) if of is kind]

    def name_of(self, place: int) -> str:
        """Return the name of a column; empty if it has none."""
        return self.header[place].strip() if self.header else ""

    def clocks(self, columns: Sequence[Column]) -> list[Column]:
        """Return those of `columns` that hold times, or else the first column of dates that changes.

        An index of pandas may have no name.
        """
        named = [column for column in columns if column.quantity == TIME and self.kinds[column.place] is not Kind.WORD]
        dates = (
            Column(self.name_of(place), place, TIME)
            for place in self.places(Kind.MOMENT)
            if any(cell != self.cells[place][0] for cell in self.cells[place])
        )
        return named or [*islice(dates, 1)]

    def has(self, column: Column) -> Mask:
        """Return (n,) True where a row has a cell in a column."""
        cells = self.cells[column.place]
        return np.ones(len(self), bool) if isinstance(cells, np.ndarray) else np.array([bool(c.strip()) for c in cells])

    def part(self, kept: Mask) -> Table:
        """Return the rows where `kept` (n,) is True."""
        places = np.flatnonzero(kept).tolist()
        cells = [of[kept] if isinstance(of, np.ndarray) else [of[at] for at in places] for of in self.cells]
        return replace(self, cells=cells, lines=[self.lines[at] for at in places] if self.lines else ())

    def noted(self, remark: str, **changes: Any) -> Table:
        """Return the table with changes, and a further remark on how it was read."""
        return replace(self, remarks=(*self.remarks, remark), **changes)

    def numbers(self, columns: Sequence[Column]) -> Vector:
        """Return (n, k) numbers; NaN where a cell is empty, or is one of a few damaged ones.

        Raises
        ------
        RecordingError : too many cells are not numbers.
        """
        return np.column_stack([self._numbers(column) for column in columns] or [np.zeros((0, 0))])

    def _numbers(self, column: Column) -> Vector:
        cells = self.cells[column.place]
        if isinstance(cells, np.ndarray):
            try:
                # a signalling NaN becomes a quiet one
                with np.errstate(invalid="ignore"):
                    return cells.astype(float)
            except (TypeError, ValueError) as error:
                raise RecordingError(f"{column.name} does not hold numbers ({error})", "write numbers") from error
        found, bad = np.full(len(cells), np.nan), []
        for i, text in enumerate(cells):
            try:
                found[i] = float(with_point(text)) if text.strip() else np.nan
            except ValueError:
                bad.append(i)
        if are_many(len(bad), cells):
            raise self._not_a_number(bad[0], column)
        return found

    def times(self, column: Column, kept: Mask) -> tuple[Vector, Decimal, str]:
        """Return the times (n,) of the rows in `kept` since the first, the first, and their unit; dates are in ns.

        A column of the part below a second, beside whole seconds, is added to these. The unit is empty if unknown.

        Raises
        ------
        RecordingError : too many cells are not times.
        """
        found, unit = self._exact(column, kept), column.unit or self.units.get(TIME, "")
        parts = [c for c in self.columns if c.quantity == NANOSECONDS and unit == "s"]
        if self.kinds[column.place] is Kind.MOMENT:
            below = [c for c in self.columns if c.quantity == TIME and c.unit in BELOW_A_SECOND and c != column]
            parts, unit = [] if any(found % S) else below, "ns"
        elif unit in ("", "s") and (of_day := since_midnight(found)) is not None:
            found, unit = of_day, "s"
        if parts:
            ticks = round(QUANTITIES[TIME][parts[0].unit or "ns"] * S)
            more = self._exact(parts[0], kept) * ticks
            if len(more) and max(more) < S:
                found, unit = found * (1 if unit == "ns" else S) + more, "ns"
        since, first = since_first(found)
        if not unit and column.name.strip().lower() == COUNTS_OF_XSENS:
            # in us, steps of the former are shorter
            unit = "0.1ms" if sample_period(since) * QUANTITIES[TIME]["0.1ms"] <= 1 / SLOWEST_HZ else ""
        return since, first, unit

    def _exact(self, column: Column, kept: Mask) -> NDArray[Any]:
        """Return times without rounding: whole numbers, decimals, or floats if the file holds such."""
        cells = self.cells[column.place]
        if isinstance(cells, np.ndarray):
            if cells.dtype.kind not in "Mm":
                return cells[kept].astype(np.int64) if cells.dtype.kind in "iu" else cells[kept]
            if np.isnat(cells[kept]).any():
                raise RecordingError(f"{column.name or 'the index'} lacks a time", "leave those lines out")
            return cells[kept].astype(f"{cells.dtype.kind}8[ns]").astype(np.int64)
        found: list[Decimal] = []
        bad: list[int] = []
        for i in np.flatnonzero(kept).tolist():
            try:
                at = parse_cell(cells[i])
                if found and ":" in cells[i] and (at > DAY_NS) != (found[-1] > DAY_NS):
                    raise ValueError(cells[i])
                found.append(at)
            except ValueError as error:
                bad.append(len(found))
                found.append(found[-1] if found else Decimal(0))
                if are_many(len(bad), cells) or bad[0] == 0:
                    raise self._not_a_number(i, column) from error
        # a spreadsheet writes some times otherwise
        for i in bad:
            found[i] = (found[i - 1] + found[min(i + 1, len(found) - 1)]) / 2
        return np.array(found, object)

    def _not_a_number(self, i: int, column: Column) -> RecordingError:
        name = column.name.strip() or f"column {column.place + 1}"
        return RecordingError(
            f"{self.name}: line {self.lines[i]}: {name} is {self.cells[column.place][i]!r}, which is not a number",
            "correct that line or leave it out",
        )


def are_many(bad: int, of: Sequence[Any] | NDArray[Any]) -> bool:
    """Return True if more than one of FEWEST is damaged, or in no order."""
    return bad * FEWEST > len(of)


def holds_number(cell: str) -> bool:
    """Return True for a number, also with a unit behind it."""
    return is_number(cell) or _WITH_UNIT(cell.strip()) is not None


def with_lists_apart(table: Table) -> Table:
    """Return a table without lists of samples in its cells, or of a sensor's three axes; others are left as text."""
    axes = axes_of_lists(table.header, [of[0] for of in table.cells]) if len(table) else []
    lists = {place: [*map(_items, cells)] for place, cells in enumerate(table.cells) if all(map(IS_LIST, cells))}
    if any(axes):
        header: list[str] = []
        apart: list[Cells] = []
        for place, of in enumerate(table.cells):
            header += axes[place] or [table.name_of(place)]
            rows = ([*_items(cell), "", "", ""][: len("xyz")] for cell in of)
            apart += map(list, zip(*rows, strict=True)) if axes[place] else [of]
        return replace(table, header=header, cells=apart)
    measured = {column.place for column in table.of_sensors}
    if not measured <= lists.keys() or len(lists) < 2 * len("xyz"):
        return table
    counts = [{*map(len, row)} for row in zip(*lists.values(), strict=True)]
    if any(len(count) > 1 for count in counts):
        raise RecordingError(f"{table.name}: its cells hold lists of different lengths", "write a line for each sample")
    lines, *cells = (np.repeat(of, [*chain(*counts)]).tolist() for of in (table.lines, *table.cells))
    cells = [[*chain(*lists[at])] if at in lists else of for at, of in enumerate(cells)]
    return table.noted("its cells hold lists of samples", cells=cells, lines=lines)


def axes_of_lists(header: Sequence[str], cells: Sequence[str]) -> list[list[str]]:
    """Return for each column the names of its axes, if it is a sensor's and its cell lists three numbers; or none."""
    return [
        axes_of(name) if IS_LIST(cell) and len(_items(cell)) == len("xyz") else []
        for name, cell in zip(header, cells, strict=False)
    ]


def _items(cell: str) -> list[str]:
    return [item.strip(" \"'") for item in cell.strip("[] \n").split(",")]


def with_units_of_cells(table: Table) -> Table:
    """Return a table with the units of its cells in their columns' names."""
    header, columns = [*table.header], [*table.cells]
    for place, cells in enumerate(columns):
        if (found := _WITH_UNIT(cells[0])) and find_unit(found[1]):
            header[place] += f" ({found[1].strip()})"
            columns[place] = [cell.removesuffix(found[1]) for cell in cells]
    return replace(table, header=header, cells=columns)
