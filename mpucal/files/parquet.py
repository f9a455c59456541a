"""Parquet files, by pyarrow: a table with the columns that a table of text has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Recording
from ..errors import RecordingError
from .arrays import recording_of_columns
from .extras import library
from .hints import NO_HINTS, Hints


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
    return recording_of_columns(arrays, hints, path.name)


def _array(column: Any, kind: Any) -> NDArray[Any]:
    values = np.asarray(column.to_numpy())
    if values.dtype.kind == "M" and not getattr(kind, "tz", None):
        # nothing says the zone: since the first of them, and no time of day
        return np.asarray((values - values[:1]).astype("timedelta64[ns]"))
    return values
