"""Arrays by name from NumPy (.npz, .npy) and MATLAB (.mat) files: columns of one length, and matrices of them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Mask, Recording, Vector
from ..errors import RecordingError
from .budget import check_size
from .hints import NO_HINTS, Hints
from .matlab import read_matlab_arrays
from .npz import DAMAGED, NEEDED
from .reading import reading
from .tables.names import ACC, GYR, TIME, Column, Table, Times, parse_column_name
from .tables.table import recording_from_table

# columns of a matrix of samples; a wider matrix has the samples as columns
WIDEST = 64
_REMEDY = "name its arrays t (n,), acc (n, 3) and gyr (n, 3), or say which is what with --columns t=NAME,ax=NAME,..."


def is_of_others(path: Path) -> bool:
    """Return True if a NumPy archive lacks the names of mpucal's own format."""
    try:
        # np.load(path) would leave a damaged file open
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return not set(NEEDED) <= set(archive.files)
    except (OSError, *DAMAGED):
        return False


def load_arrays(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a file's arrays.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; the message names what is missing.
    """
    try:
        with reading(path):
            of_matlab = path.suffix.lower() == ".mat"
            found = dict(read_matlab_arrays(path.read_bytes(), path) if of_matlab else _read_numpy(path))
    except DAMAGED as error:
        # NumPy takes unknown bytes for pickled objects, and advises to load these, which would run code
        said = "damaged, or pickled Python objects" if "pickle" in str(error) else error
        raise RecordingError(f"{path} is not a whole file of arrays ({said})", _REMEDY) from error
    columns = columns_of_arrays(found)
    if not columns:
        raise RecordingError(f"{path.name} holds no columns of numbers", _REMEDY)
    return recording_from_arrays(columns, hints, path.name)


def _read_numpy(path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    with path.open("rb") as file:
        # no pickles: a recording must not run code
        loaded = np.load(file, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            yield from _fields(path.stem, loaded)
            return
        with loaded as archive:
            check_size(path, sum(each.file_size for each in archive.zip.infolist()))
            for name in archive.files:
                yield from _fields(name, archive[name])


def _fields(name: str, array: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    if array.dtype.names is None:
        yield name, array
    for field in array.dtype.names or ():
        yield field, array[field]


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
    sensors = {name: table for name, table in tables.items() if _axes(name, table.shape[1])}
    n = max(len(table) for table in (sensors or tables).values())
    found: dict[str, NDArray[Any]] = {}
    for name, table in tables.items():
        if len(table) == n and table.shape[1] <= WIDEST:
            names = _axes(name, table.shape[1]) or [f"{name}({i + 1})" for i in range(table.shape[1])]
            names = [name] if table.shape[1] == 1 else names
            found |= dict(zip(names, table.T, strict=True))
    return found


def _axes(name: str, width: int) -> list[str]:
    """Return the names of the columns of a sensor's matrix; empty for another matrix."""
    last = name.rpartition(".")[2]
    for word in (last, *re.split(r"[^A-Za-z]+", last)):
        found = parse_column_name(f"{word}_x", 0) if width == 3 and word else None
        if found is not None and found.quantity in (ACC, GYR):
            return [f"{word}_{axis}" for axis in "xyz"]
    return []


@dataclass(frozen=True)
class ArrayTable(Table):
    """A table whose columns are arrays (n,) under their names."""

    arrays: Mapping[str, NDArray[Any]]

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


def recording_from_arrays(arrays: Mapping[str, NDArray[Any]], hints: Hints, name: str) -> Recording:
    """Return the recording in arrays (n,) by name; see recording_from_table."""
    return recording_from_table(ArrayTable(name, list(arrays), arrays), hints)
