"""Tables of trials: a line for each group of rows, a column for each figure of a group."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import attrgetter
from types import SimpleNamespace
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from mpucal.result.calibration import GOOD, REFUSED, USABLE

Column = Callable[[Sequence[Any]], Any]
# what a trial found in a scenario: its attributes are figures and names
Row = SimpleNamespace
WIDTH = 170


def grouped(rows: Iterable[Any], *names: str) -> dict[Any, list[Any]]:
    """Return the rows by these attributes, in the order in which their values come."""
    groups: dict[Any, list[Any]] = {}
    for row in rows:
        groups.setdefault(attrgetter(*names)(row), []).append(row)
    return groups


def known(rows: Iterable[Any], name: str) -> list[float]:
    """Return the known values of an attribute, of which a row may have several or none."""
    values = [getattr(row, name, math.nan) for row in rows]
    flat = [each for value in values for each in (value if isinstance(value, tuple) else (value,))]
    return [each for each in flat if not math.isnan(each)]


def over(name: str, make: Callable[[list[float]], Any] = np.mean) -> Column:
    """Return a column: what `make` makes of an attribute's known values; empty where none is known."""
    return lambda rows: float(make(values)) if (values := known(rows, name)) else None


def count(name: str, *wanted: Any) -> Column:
    """Return a column: the number of rows whose attribute is one of these values, or is true where none is given."""
    return lambda rows: sum(getattr(row, name) in wanted if wanted else bool(getattr(row, name)) for row in rows)


def first(name: str) -> Column:
    """Return a column: the attribute of the first row."""
    return lambda rows: getattr(rows[0], name, None)


VERDICTS: dict[str, Column] = {verdict: count("verdict", verdict) for verdict in (GOOD, USABLE, REFUSED)}


def frequencies(values: Iterable[Any], most: int | None = None) -> str:
    """Return how often each value comes, the most frequent first."""
    return ", ".join(f"{value} {n}" for value, n in Counter(values).most_common(most))


def table(groups: Mapping[Any, Sequence[Any]], columns: Mapping[str, Column], title: str | None = None) -> Table:
    """Return a table with a line a group: its name, a tuple in columns of its own, and each column's figure.

    A column without any figure is left out.
    """
    cells = {heading: [cell(of(rows)) for rows in groups.values()] for heading, of in columns.items()}
    cells = {heading: texts for heading, texts in cells.items() if any(texts)}
    names = [name if isinstance(name, tuple) else (name,) for name in groups]
    lines = Table(title=title)
    for heading in [*[""] * max(map(len, names), default=1), *cells]:
        lines.add_column(heading, justify="right" if heading else "left")
    for name, *texts in zip(names, *cells.values(), strict=True):
        lines.add_row(*map(cell, name), *texts)
    return lines


def plain_table(rows: Sequence[Mapping[str, Any]], title: str | None = None) -> Table:
    """Return a table with a line a row, whose keys are the columns; text stands to the left."""
    lines = Table(title=title)
    for heading, value in rows[0].items():
        lines.add_column(heading, justify="left" if isinstance(value, str) else "right")
    for row in rows:
        lines.add_row(*map(cell, row.values()))
    return lines


def cell(value: Any) -> str:
    """Return the text of a value: three digits of a number, all before the point, and nothing where it is not known."""
    match value:
        case None:
            return ""
        case float():
            return "" if math.isnan(value) else f"{value:,.0f}" if 1e3 <= abs(value) < 1e9 else f"{value:.3g}"
        case _:
            return str(value)


def show(*tables: Table) -> None:
    """Print tables as wide as their content, whatever the terminal."""
    for one in tables:
        Console(width=WIDTH).print(one)
