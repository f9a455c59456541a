"""Files of arrays by name: NumPy (.npz, .npy), MATLAB (.mat), HDF5, Parquet, Feather, and JSON."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import reading
from ..clocks import S
from ..errors import RecordingError
from .matlab import is_matlab, read_matlab_arrays
from .npz import DAMAGED
from .reading import MEMORY_PER_TEXT, check_size, import_extra
from .tables.cells import is_number
from .tables.times import UTC_NS

NAME_ARRAYS = (
    "name its arrays t (n,), acc (n, 3) and gyr (n, 3), or say which is what with --columns t=NAME,ax=NAME,..."
)
Arrays = Iterator[tuple[str, NDArray[Any]]]
INDEX = "index_time"


def holds_arrays(path: Path) -> bool:
    """Return True if a file's suffix is that of arrays, and it is no table of text: imu_tk names these .mat, too."""
    suffix = path.suffix.lower()
    return suffix in _READERS and (suffix != ".mat" or is_matlab(path))


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays in a file, by name.

    Raises
    ------
    RecordingError : it cannot be read.
    """
    try:
        with reading(path):
            return dict(_READERS[path.suffix.lower()](path))
    except DAMAGED as error:
        # NumPy takes unknown bytes for pickled objects, and advises to load these, which would run code
        pickled = "pickle" in str(error)
        why = "damaged, or pickled Python objects" if pickled else error
        remedy = NAME_ARRAYS if pickled else "it is cut short or damaged: copy or export it again"
        raise RecordingError(f"{path} is not a whole file of arrays ({why})", remedy) from error


def _read_numpy(path: Path) -> Arrays:
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


def _fields(name: str, array: NDArray[Any]) -> Arrays:
    if array.dtype.names is None:
        yield name, array
    for field in array.dtype.names or ():
        yield field, array[field]


def _read_json(path: Path) -> Arrays:
    check_size(path, MEMORY_PER_TEXT * path.stat().st_size)
    text = path.read_text(encoding="utf-8-sig")
    try:
        document = json.loads(text)
    except ValueError:
        # an object on each line, or one after the other, of which the last may be torn
        lines = [line for line in text.replace("}{", "}\n{").split("\n") if line.strip()]
        lines = lines if text.endswith("\n") else lines[:-1]
        if not lines or lines[0].strip() in ("{", "["):
            raise
        document = [json.loads(line) for line in lines]
    arrays = [*_json_arrays("", document)]
    indices = [array for name, array in arrays if name == INDEX]
    if any(not np.array_equal(index, indices[0]) for index in indices):
        raise RecordingError(
            f"{path}: its columns have different indices", "export one table, in which all columns have one index"
        )
    return iter(arrays)


def _json_arrays(name: str, value: Any) -> Arrays:
    """Yield name and array of the numbers in a value of JSON; of a list of objects, a column for each key."""
    value = [_unpacked(each) for each in value] if isinstance(value, list) else value
    value = _unpacked(value)
    if isinstance(value, dict) and value and all(map(is_number, value)):
        # a table of pandas, or a column, by its index: small whole numbers count the rows
        if not all(map(str.isdecimal, value)) or float(next(iter(value))) >= UTC_NS[0] / S:
            yield from _json_arrays(INDEX, [*value])
        value = list(value.values())
    if isinstance(value, list) and any(isinstance(row, dict) for row in value):
        rows = [each for row in value for each in _samples(row if isinstance(row, dict) else {})]
        value = {key: [row.get(key) for row in rows] for key in dict.fromkeys(chain(*rows))}
    if isinstance(value, dict):
        if {"sensors", "values"} <= value.keys():
            # Edge Impulse's data acquisition format
            of = value["sensors"]
            named = [f"{each['name']} ({each['units']})" if each.get("units") else each["name"] for each in of]
            yield from zip(named, np.asarray(value.pop("values"), float).T, strict=False)
        for key, each in value.items():
            yield from _json_arrays(f"{name}.{key}".removeprefix("."), each)
        return
    for kind in (None, float, "M8[ns]", str):
        try:
            with warnings.catch_warnings(action="ignore"):
                # NumPy warns of a zone
                array = np.asarray(value, kind)
        except (TypeError, ValueError):
            continue
        if array.dtype.kind in "iufM" or kind is str:
            yield name, array.reshape(len(array), -1) if array.ndim > 2 else array
            return
    if all(isinstance(row, list) for row in value) and (flat := [[*_flat(row)] for row in value]) != value:
        yield from _json_arrays(name, flat)


def _unpacked(value: Any) -> Any:
    """Return an object for a list of pairs of a key and a value, and numbers for a text of several."""
    if isinstance(value, list) and value and all(_is_pair(each) for each in value):
        return dict(value)
    if isinstance(value, str) and "," in value and all(map(is_number, cells := value.split(","))):
        return [float(cell) for cell in cells]
    return value


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and isinstance(value[0], str) and not is_number(value[0])


def _flat(row: list[Any]) -> Iterator[Any]:
    for each in row:
        yield from _flat(each) if isinstance(each, list) else [each]


def _samples(row: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the samples of an object that holds lists of objects, as a packet does, or else the object alone."""
    lists = {key: each for key, each in row.items() if isinstance(each, list) and each and isinstance(each[0], dict)}
    several = zip_longest(*lists.values())
    return [{**row, **dict(zip(lists, sample, strict=True))} for sample in several] if lists else [row]


def _read_arrow(path: Path) -> Arrays:
    kind = path.suffix[1:].lower()
    arrow, reader = (import_extra(name, "parquet", path) for name in ("pyarrow", f"pyarrow.{kind}"))
    try:
        table = reader.read_table(path)
    except (arrow.ArrowException, OSError) as error:
        raise ValueError(error) from error
    for place, field in enumerate(table.schema):
        values = np.asarray(table.column(place).to_numpy())
        if values.dtype.kind == "M" and not getattr(field.type, "tz", None):
            # without a zone they are no times of day, and count from the first
            values = np.asarray((values - values[:1]).astype("timedelta64[ns]"))
        yield field.name, values


_READERS = {
    **dict.fromkeys((".mat", ".h5", ".hdf5", ".hdf"), read_matlab_arrays),
    **dict.fromkeys((".npz", ".npy"), _read_numpy),
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), _read_json),
    **dict.fromkeys((".parquet", ".feather"), _read_arrow),
}
