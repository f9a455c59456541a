"""Parquet files, by pyarrow: a table with the columns that a table of text has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Recording, Vector
from ..errors import RecordingError
from .extras import library
from .hints import NO_HINTS, Hints
from .tables.names import ACC, GYR, TEMPERATURE, TIME, Column, columns_of, three, threes
from .tables.streams import recording_of, with_gravity
from .tables.table import chosen, remarks, whole
from .tables.times import Stream


def load_parquet(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """The recording in a Parquet file.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; what is missing is named.
    """
    arrow, parquet = library("pyarrow", "parquet", path), library("pyarrow.parquet", "parquet", path)
    try:
        table = parquet.read_table(path)
        arrays = {field.name: _array(table.column(place), field.type) for place, field in enumerate(table.schema)}
    except (arrow.ArrowException, OSError, ValueError, TypeError) as error:
        raise RecordingError(f"{path} is no whole Parquet file ({error})", "write it again") from error
    names = list(table.column_names)
    columns = chosen(names, hints) if hints.columns else columns_of(names)
    all_acc, gyr = threes(columns, ACC), three(columns, GYR)
    if not all_acc or not gyr:
        raise RecordingError(
            f"{path.name} holds no columns of {'a gyroscope' if all_acc else 'an accelerometer'}; its columns are"
            f" {', '.join(names)}",
            "name them with --columns t=NAME,ax=NAME,...",
        )
    clocks = [column for column in columns if column.quantity == TIME and arrays[column.name].dtype.kind in "iufMm"]
    # the index of pandas has no name where nobody gave it one
    clocks = clocks or [Column(n, i, TIME) for i, n in enumerate(names) if arrays[n].dtype.kind in "mM"][:1]
    accelerometers, w = [_stream(arrays, of, clocks) for of in all_acc], _stream(arrays, gyr, clocks)
    place = with_gravity(accelerometers)
    acc, a = all_acc[place], accelerometers[place]
    warm = [c for c in columns if c.quantity == TEMPERATURE and arrays[c.name].dtype.kind in "iuf"]
    with np.errstate(invalid="ignore"):
        temperature_c = arrays[warm[0].name].astype(float) if warm and len(a.values) == table.num_rows else None
    return recording_of(a, w, hints, path.name, temperature_c, remarks(columns, acc))


def _array(column: Any, kind: Any) -> NDArray[Any]:
    values = np.asarray(column.to_numpy())
    if values.dtype.kind == "M" and not getattr(kind, "tz", None):
        # nothing says the zone: since the first of them, and no time of day
        return np.asarray((values - values[:1]).astype("timedelta64[ns]"))
    return values


def _stream(arrays: dict[str, NDArray[Any]], of: tuple[Column, ...], clocks: list[Column]) -> Stream:
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
        return Stream(None, values[there], unit=unit, places=np.flatnonzero(there), lost=lost)
    times, time_unit = arrays[clock.name][there], clock.unit
    if times.dtype.kind in "Mm":
        if np.isnat(times).any():
            raise RecordingError(f"{clock.name or 'the index'} lacks a time", "leave those lines out")
        times, time_unit = times.astype(f"{times.dtype.kind}8[ns]").astype(np.int64), "ns"
    elif times.dtype.kind in "iu":
        times = times.astype(np.int64)
    return Stream(times, values[there], time_unit, unit, lost=lost)
