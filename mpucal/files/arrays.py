"""Arrays by name, of NumPy (.npz, .npy) and MATLAB (.mat): columns of one length, and matrices of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Recording, Vector
from ..errors import RecordingError
from .budget import afford
from .hints import NO_HINTS, ROLES, Hints
from .matlab import arrays_of
from .npz import DAMAGED, NEEDED
from .rows import cannot_read
from .tables.guess import guessed
from .tables.names import ACC, GYR, TEMPERATURE, TIME, Column, celsius, column_named, columns_of, three, threes
from .tables.streams import recording_of, with_gravity
from .tables.table import chosen, remarks, whole
from .tables.times import Stream

# columns of a matrix that is one of samples, at most
WIDEST = 64
_REMEDY = "name its arrays t (n,), acc (n, 3) and gyr (n, 3), or say which is what with --columns t=NAME,ax=NAME,..."


def is_of_others(path: Path) -> bool:
    """Whether an archive of NumPy lacks the names of mpucal's own."""
    try:
        # numpy leaves a file open that it opened itself, and that is no archive
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return not set(NEEDED) <= set(archive.files)
    except (OSError, *DAMAGED):
        return False


def load_arrays(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """The recording in a file's arrays.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; what is missing is named.
    """
    try:
        found = dict(arrays_of(path) if path.suffix.lower() == ".mat" else _numpy(path))
    except OSError as error:
        raise cannot_read(path, error) from error
    except NotImplementedError as error:
        raise RecordingError(
            f"{path} is of MATLAB 7.3, which is HDF5, or of level 4", "save it with save(NAME, '-v7')"
        ) from error
    except DAMAGED as error:
        # NumPy takes what it does not know for Python's objects, and advises to run them
        said = "damaged, or of Python's objects" if "pickle" in str(error) else error
        raise RecordingError(f"{path} is no whole file of arrays ({said})", _REMEDY) from error
    columns = _columns(found)
    if not columns:
        raise RecordingError(f"{path.name} holds no columns of numbers", _REMEDY)
    return recording_of_columns(columns, hints, path.name)


def _numpy(path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    with path.open("rb") as file:
        # no pickles: a recording must not run code
        loaded = np.load(file, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            yield from _fields(path.stem, loaded)
            return
        with loaded as archive:
            afford(path, sum(each.file_size for each in archive.zip.infolist()))
            for name in archive.files:
                yield from _fields(name, archive[name])


def _fields(name: str, array: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    if array.dtype.names is None:
        yield name, array
    for field in array.dtype.names or ():
        yield field, array[field]


def _columns(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Name -> (n,), of all arrays that have as many samples as the most have."""
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
    """Names of the columns of a sensor's matrix."""
    last = name.rpartition(".")[2]
    of_a_sensor = (found := column_named(f"{last}_x", 0)) is not None and found.quantity in (ACC, GYR)
    return [f"{last}_{axis}" for axis in "xyz"] if width == 3 and of_a_sensor else []


def recording_of_columns(arrays: Mapping[str, NDArray[Any]], hints: Hints, name: str) -> Recording:
    """The recording in columns (n,) by name.

    Raises
    ------
    RecordingError : they do not say all that is needed; what is missing is named.
    """
    names, said = list(arrays), ""
    columns = chosen(names, hints) if hints.columns else columns_of(names)
    all_acc, gyr = threes(columns, ACC), three(columns, GYR)
    if not hints.columns and not (all_acc and gyr):
        numeric = [n for n in names if arrays[n].dtype.kind in "iuf"]
        order, said = guessed(np.column_stack([arrays[n].astype(float) for n in numeric]), hints)
        if order:
            columns = chosen(names, Hints(columns={role: numeric[place] for role, place in order.items()}))
            all_acc, gyr = threes(columns, ACC), three(columns, GYR)
    if not all_acc or not gyr:
        raise RecordingError(
            f"{name} holds no columns of {'a gyroscope' if all_acc else 'an accelerometer'}; its columns are"
            f" {', '.join(names)}",
            f"name them with --columns t=NAME,ax=NAME,... or their order, such as --columns {','.join(ROLES)}",
        )
    clocks = [column for column in columns if column.quantity == TIME and arrays[column.name].dtype.kind in "iufMm"]
    # the index of pandas has no name where nobody gave it one
    clocks = clocks or [Column(n, i, TIME) for i, n in enumerate(names) if arrays[n].dtype.kind in "mM"][:1]
    accelerometers, w = [_stream(arrays, of, clocks) for of in all_acc], _stream(arrays, gyr, clocks)
    place = with_gravity(accelerometers)
    acc, a = all_acc[place], accelerometers[place]
    warm = [c for c in columns if c.quantity == TEMPERATURE and arrays[c.name].dtype.kind in "iuf"]
    with np.errstate(invalid="ignore"):
        temperature_c = celsius(arrays[warm[0].name].astype(float)[a.there]) if warm else None
    return recording_of(a, w, hints, name, temperature_c, [*remarks(columns, acc), *filter(None, [said])])


def _stream(arrays: Mapping[str, NDArray[Any]], of: tuple[Column, ...], clocks: list[Column]) -> Stream:
    try:
        # of a signalling NaN numpy says that it is none
        with np.errstate(invalid="ignore"):
            values: Vector = np.column_stack([arrays[column.name].astype(float) for column in of])
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{of[0].name} and the like hold no numbers ({error})", "write numbers") from error
    values = -values if of[0].turned_around else values
    there, lost = whole(values)
    unit = of[0].unit if len({column.unit for column in of}) == 1 else ""
    clock = min((c for c in clocks if c.of in ("", of[0].quantity)), key=lambda c: (not c.of, c.rank), default=None)
    if clock is None:
        return Stream(None, values[there], unit=unit, there=there, lost=lost)
    times, time_unit = arrays[clock.name][there], clock.unit
    if times.dtype.kind in "Mm":
        if np.isnat(times).any():
            raise RecordingError(f"{clock.name or 'the index'} lacks a time", "leave those lines out")
        times, time_unit = times.astype(f"{times.dtype.kind}8[ns]").astype(np.int64), "ns"
    elif times.dtype.kind in "iu":
        times = times.astype(np.int64)
    return Stream(times, values[there], time_unit, unit, there=there, lost=lost)
