"""Arrays of NumPy, MATLAB, Parquet or JSON as tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..hints import ROLES
from .guess import is_clock
from .names import axes_of, names_both, parse_header
from .several import INSTANCE, MOST_SENSORS
from .table import Table
from .text import stated_rate_hz

Arrays = Mapping[str, NDArray[Any]]
# the columns of one sensor's table without names, as data sets have them
UNNAMED = ["time", "x", "y", "z"]


def table_of_arrays(name: str, arrays: Arrays) -> Table | None:
    """Return the table of a file's arrays; None if it has no columns of numbers."""
    columns = _columns(arrays)
    header = list(columns) if len(columns) != len(UNNAMED) or parse_header(list(columns)) else UNNAMED
    rate_hz = stated_rate_hz(_single_numbers(arrays))
    return Table(name, header, [*columns.values()], rate_hz=rate_hz) if columns else None


def table_of_labels(name: str, arrays: Arrays) -> Table | None:
    """Return the first matrix of both sensors whose columns the texts NAME_label name, as Mission Planner writes it."""
    for of, labels in arrays.items():
        matrix = arrays.get(of.removesuffix("_label"), labels)
        if labels.dtype.kind == "U" and matrix.ndim > 1 and matrix.shape[1] == labels.size:
            table = Table(name, [INSTANCE.get(label, label) for label in labels.ravel().tolist()], [*matrix.T])
            if names_both(table.columns):
                return table
    return None


def _columns(arrays: Arrays) -> dict[str, NDArray[Any]]:
    """Return name -> (n,) for the arrays of the largest number of samples, of which a matrix has more than columns."""
    tables = {}
    for name, array in arrays.items():
        if array.dtype.kind in "iufMmU" and 0 < np.squeeze(array).ndim <= 2:
            table = np.squeeze(array)
            table = table[:, None] if table.ndim == 1 else table
            tables[name] = table.T if 0 < table.shape[0] < table.shape[1] else table
    if not tables:
        return {}
    sensors = {name: table for name, table in tables.items() if table.shape[1] == 3 and axes_of(name)}
    n = max(len(table) for table in (sensors or tables).values())
    found: dict[str, NDArray[Any]] = {}
    for name, table in tables.items():
        if len(table) == n and table.shape[1] <= MOST_SENSORS * len(ROLES[1:]):
            names = axes_of(name) if name in sensors else [f"{name}({i + 1})" for i in range(table.shape[1])]
            names = [name] if table.shape[1] == 1 else names
            found |= dict(zip(names, table.T, strict=True))
    return found


def _single_numbers(arrays: Arrays) -> str:
    """Return the single numbers among arrays as lines of text, of which one may state the sample rate."""
    single = {name.rpartition(".")[2]: array for name, array in arrays.items() if array.size == 1}
    numbers = {name: array.item() for name, array in single.items() if array.dtype.kind in "iuf"}
    if numbers.get("interval_ms"):
        numbers["rate"] = 1000.0 / numbers["interval_ms"]
    return "\n".join(f"{name}: {number}" for name, number in numbers.items())


def with_clocks(arrays: Arrays) -> dict[str, NDArray[Any]]:
    """Return arrays with those of a sensor's times, x, y and z (n, 4) as a structure of four."""
    found: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        timed = array.dtype.kind in "iuf" and array.ndim == 2 and array.shape[1] == len(UNNAMED)
        if timed and axes_of(name) and is_clock(array[:, 0].astype(float)):
            found |= {f"{name}.{of}": column for of, column in zip(UNNAMED, array.T, strict=True)}
        else:
            found[name] = array
    return found


def tables_of_arrays(arrays: Arrays) -> dict[str, Table]:
    """Return each structure, or timetable, of arrays (n,) as a table under its name."""
    found: dict[str, dict[str, NDArray[Any]]] = {}
    for name, array in arrays.items():
        of, _, field = name.rpartition(".")
        if of and array.ndim and array.size == max(array.shape):
            found.setdefault(of, {})[field] = array.ravel()
    return {
        of: Table(of, list(fields), [*fields.values()])
        for of, fields in found.items()
        if len({len(array) for array in fields.values()}) == 1
    }
