"""The recording in a file of arrays; see array_files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..clocks.stamps import FEWEST
from ..data import Recording
from ..errors import RecordingError
from .array_files import NAME_ARRAYS, read_arrays
from .hints import NO_HINTS, Hints
from .npz import DAMAGED, NEEDED
from .reading import first_bytes
from .tables.array_table import table_of_arrays, table_of_labels, tables_of_arrays, with_clocks
from .tables.labelled import pivot
from .tables.load import recording_from_table
from .tables.phone import is_pair, recording_of_tables

_IS_OWN = b'"D":', b'"b_a":'


def is_of_others(path: Path) -> bool:
    """Return True if a NumPy archive lacks the names of mpucal's own format."""
    try:
        # np.load(path) would leave a damaged file open
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return not set(NEEDED) <= set(archive.files)
    except (OSError, *DAMAGED):
        return False


def is_json_of_samples(path: Path) -> bool:
    """Return True if a file of JSON begins with many numbers, and is no calibration."""
    begun = first_bytes(path)
    return sum(byte in b",:" for byte in begun) > 2 * FEWEST and not all(key in begun for key in _IS_OWN)


def load_arrays(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a file's arrays.

    Raises
    ------
    RecordingError : it cannot be read, or does not say all that is needed; the message names what is missing.
    """
    found = with_clocks(read_arrays(path))
    if not hints.columns and is_pair(tables := tables_of_arrays(found)):
        return recording_of_tables(path.name, tables, hints)
    table = table_of_labels(path.name, found) or table_of_arrays(path.name, found)
    if table is None:
        raise RecordingError(f"{path.name} holds no columns of numbers", NAME_ARRAYS)
    return recording_from_table(pivot(table) or table, hints)
