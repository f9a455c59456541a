"""Tables whose columns are arrays, from NumPy, MATLAB or a data frame."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...data import Mask, Vector
from ...errors import RecordingError
from .names import TIME, Column, Table, Times, axes_of, parse_header

# columns of a matrix of samples; a wider matrix has the samples as columns
WIDEST = 64
# the columns of one sensor's table without names, as data sets have them
UNNAMED = ["time", "x", "y", "z"]
# above a table without times, as `Fs,100`, `Sample rate: 52 Hz` or `# Config: data_rate = 2000.0 Hz, filter = ...`
RATE = re.compile(
    r"(?:^[#%/ ]{0,5}|(?<![a-z])(?:sampl(?:e|ing)|data|output|acquisition|update|sensor|imu|log(?:ging)?|recording))"
    r"[ _]?"
    r"(?:(?<![a-z])fs|rate|freq\w{0,6})[^\w\n]{1,9}(?:\(?Hz\)?[^\w\n]{1,9})?"
    r"([1-9]\d{0,4}(?:\.\d{1,6})?)[ ,]*(?:Hz|$)",
    re.IGNORECASE | re.MULTILINE,
)


@dataclass(frozen=True)
class ArrayTable(Table):
    """A table whose columns are arrays (n,) under their names."""

    arrays: Mapping[str, NDArray[Any]]

    @classmethod
    def of(cls, name: str, arrays: Mapping[str, NDArray[Any]]) -> ArrayTable | None:
        """Return the table of a file's arrays; None if it has no columns of numbers."""
        columns = columns_of_arrays(arrays)
        header = list(columns) if len(columns) != len(UNNAMED) or parse_header(list(columns)) else UNNAMED
        found = dict(zip(header, columns.values(), strict=True))
        return cls(name, header, found, rate_hz=stated_rate_hz(_single_numbers(arrays))) if columns else None

    def numbers(self, columns: Sequence[Column]) -> Vector:
        """See Table."""
        arrays = [self.arrays[self.header[column.place]] for column in columns]
        try:
            # a signalling NaN becomes a quiet one
            with np.errstate(invalid="ignore"):
                return np.column_stack([array.astype(float) for array in arrays] or [np.zeros((0, 0))])
        except (TypeError, ValueError) as error:
            raise RecordingError(
                f"{columns[0].name} and the like do not hold numbers ({error})", "write numbers"
            ) from error

    def numeric_places(self) -> list[int]:
        """See Table."""
        return [place for place, name in enumerate(self.header) if self.arrays[name].dtype.kind in "iuf"]

    def has(self, column: Column) -> Mask:
        """See Table."""
        return np.ones(len(self.arrays[self.header[column.place]]), bool)

    def clocks(self, columns: Sequence[Column]) -> list[Column]:
        """See Table; an index of pandas may have no name, and is a clock if it holds dates."""
        kinds = [self.arrays[name].dtype.kind for name in self.header]
        named = [c for c in columns if c.quantity == TIME and kinds[c.place] in "iufMm"]
        return named or [Column(name, i, TIME) for i, name in enumerate(self.header) if kinds[i] in "mM"][:1]

    def times(self, column: Column, kept: Mask) -> tuple[Times, str]:
        """See Table."""
        times = self.arrays[self.header[column.place]][kept]
        if times.dtype.kind in "Mm":
            if np.isnat(times).any():
                raise RecordingError(f"{column.name or 'the index'} lacks a time", "leave those lines out")
            return times.astype(f"{times.dtype.kind}8[ns]").astype(np.int64), "ns"
        return times.astype(np.int64) if times.dtype.kind in "iu" else times, column.unit


def columns_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return name -> (n,) for the arrays of the largest number of samples."""
    tables = {}
    for name, array in arrays.items():
        if array.dtype.kind in "iufMm" and 0 < np.squeeze(array).ndim <= 2:
            table = np.squeeze(array)
            table = table[:, None] if table.ndim == 1 else table
            tables[name] = table.T if table.shape[0] <= WIDEST < table.shape[1] else table
    if not tables:
        return {}
    sensors = {name: table for name, table in tables.items() if table.shape[1] == 3 and axes_of(name)}
    n = max(len(table) for table in (sensors or tables).values())
    found: dict[str, NDArray[Any]] = {}
    for name, table in tables.items():
        if len(table) == n and table.shape[1] <= WIDEST:
            names = axes_of(name) if name in sensors else [f"{name}({i + 1})" for i in range(table.shape[1])]
            names = [name] if table.shape[1] == 1 else names
            found |= dict(zip(names, table.T, strict=True))
    return found


def _single_numbers(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the single numbers among arrays as lines of text, of which one may state the sample rate."""
    single = {name.rpartition(".")[2]: array for name, array in arrays.items() if array.size == 1}
    numbers = {name: array.item() for name, array in single.items() if array.dtype.kind in "iuf"}
    if numbers.get("interval_ms"):
        numbers["rate"] = 1000.0 / numbers["interval_ms"]
    return "\n".join(f"{name}: {number}" for name, number in numbers.items())


def stated_rate_hz(text: str) -> float | None:
    """Return the sample rate that a text states; None if it states none."""
    found = RATE.search(text)
    return float(found[1]) if found else None


def tables_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> dict[str, ArrayTable]:
    """Return each structure, or timetable, of arrays (n,) as a table under its name."""
    found: dict[str, dict[str, NDArray[Any]]] = {}
    for name, array in arrays.items():
        of, _, field = name.rpartition(".")
        if of and array.ndim and array.size == max(array.shape):
            found.setdefault(of, {})[field] = array.ravel()
    return {
        of: ArrayTable(of, list(fields), fields)
        for of, fields in found.items()
        if len({len(array) for array in fields.values()}) == 1
    }
