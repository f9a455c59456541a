"""Tables of trials: a line for each group of them, a column for each number of a group."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from rich.console import Console
from rich.table import Table

Row = TypeVar("Row")
Key = TypeVar("Key", bound=Hashable)


def grouped(rows: Iterable[Row], key: Callable[[Row], Key]) -> dict[Key, list[Row]]:
    """The rows by key, in the order in which keys come."""
    groups: dict[Key, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def table(
    groups: Mapping[Any, Sequence[Row]], columns: Mapping[str, Callable[[Sequence[Row]], Any]], title: str | None = None
) -> Table:
    """A line a group: its name, and each column's value of the rows. A tuple of names takes a column each.

    A column that says nothing of any group is left out.
    """
    lines = Table(title=title)
    told = {heading: [cell(of(rows)) for rows in groups.values()] for heading, of in columns.items()}
    told = {heading: cells for heading, cells in told.items() if any(cells)}
    depth = max((len(_parts(name)) for name in groups), default=1)
    for heading in [*[""] * depth, *told]:
        lines.add_column(heading, justify="right" if heading else "left")
    for name, *cells in zip(groups, *told.values(), strict=True):
        lines.add_row(*map(cell, _parts(name)), *cells)
    return lines


def plain_table(rows: Sequence[Mapping[str, Any]], title: str | None = None) -> Table:
    """A line a row, whose keys are the columns; text stands to the left."""
    lines = Table(title=title)
    for heading, value in rows[0].items():
        lines.add_column(heading, justify="left" if isinstance(value, str) else "right")
    for row in rows:
        lines.add_row(*map(cell, row.values()))
    return lines


def cell(value: Any) -> str:
    """Text of a value: three digits of a number, all before the point, and nothing of what is not known."""
    match value:
        case None:
            return ""
        case float():
            return "" if math.isnan(value) else f"{value:,.0f}" if 1e3 <= abs(value) < 1e9 else f"{value:.3g}"
        case _:
            return str(value)


def show(*tables: Table, width: int = 140) -> None:
    """Print them, as wide as their content, whatever the terminal."""
    console = Console(width=width)
    for one in tables:
        console.print(one)


def _parts(name: Any) -> tuple[Any, ...]:
    return name if isinstance(name, tuple) else (name,)
