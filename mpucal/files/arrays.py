"""Arrays by name from NumPy (.npz, .npy) and MATLAB (.mat) files: columns of one length, and matrices of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Recording
from ..errors import RecordingError
from .budget import check_size
from .hints import NO_HINTS, Hints
from .matlab import read_matlab_arrays
from .npz import DAMAGED, NEEDED
from .reading import reading
from .tables.array_table import ArrayTable, columns_of_arrays, stated_rate, tables_of_arrays
from .tables.phone import is_pair, recording_of_tables
from .tables.table import recording_from_table, stated_rate_hz

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
    if not hints.columns and is_pair(tables := tables_of_arrays(found)):
        return recording_of_tables(path.name, tables, hints)
    columns = columns_of_arrays(found)
    if not columns:
        raise RecordingError(f"{path.name} holds no columns of numbers", _REMEDY)
    table = ArrayTable(path.name, list(columns), columns, rate_hz=stated_rate_hz(stated_rate(found)))
    return recording_from_table(table, hints)


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
