"""Parquet files, by pyarrow, with the same columns as tables of text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data import Recording
from ..errors import RecordingError
from .hints import NO_HINTS, Hints
from .reading import import_extra
from .tables.array_table import ArrayTable
from .tables.table import recording_from_table


def load_parquet(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a Parquet file.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; the message names what is missing.
    """
    arrow, parquet = (import_extra(name, "parquet", path) for name in ("pyarrow", "pyarrow.parquet"))
    try:
        table = parquet.read_table(path)
        arrays = {field.name: _array(table.column(place), field.type) for place, field in enumerate(table.schema)}
    except (arrow.ArrowException, OSError, ValueError, TypeError) as error:
        raise RecordingError(f"{path} is not a whole Parquet file ({error})", "write it again") from error
    return recording_from_table(ArrayTable(path.name, list(arrays), arrays), hints)


def _array(column: Any, kind: Any) -> NDArray[Any]:
    values = np.asarray(column.to_numpy())
    if values.dtype.kind == "M" and not getattr(kind, "tz", None):
        # without a zone they are no times of day, and count from the first
        return np.asarray((values - values[:1]).astype("timedelta64[ns]"))
    return values
