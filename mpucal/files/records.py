"""Binary records of equal size (.bin), as loggers write them without a description: one sensor's numbers, or several's.

The bytes of a record are like those of the one before, which shows its size; gravity and its turning show which type
of numbers it holds, and where. Nothing shows the unit of its clock, so that samples have no times.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arguments import reading
from ..data import Recording
from ..errors import RecordingError, UsageError
from .hints import NO_HINTS, ROLES, Hints
from .reading import MEMORY_PER_TEXT, MOST_ODD, SNIFFED, check_size
from .tables.columns import measured
from .tables.guess import is_clock, is_even_clock, side_by_side
from .tables.load import recording_from_table
from .tables.shown_units import typical_size
from .tables.table import Table
from .vehicle_logs import is_dataflash

# bytes of a record: of six numbers of 16 bits, and of an array of sensors; and numbers that it may hold
SIZES = range(12, 513)
TYPES = {"<i2": "16 bits", ">i2": "16 bits, the high byte first", "<f4": "32 bits", "<f8": "64 bits"}


def load_records(path: Path, hints: Hints = NO_HINTS) -> Recording:
    """Return the recording in a file of records.

    Raises
    ------
    RecordingError : it holds no such records, or none in which gravity turns. UsageError : hints for a dataflash log.
    """
    with reading(path):
        check_size(path, MEMORY_PER_TEXT * path.stat().st_size)
        data = np.fromfile(path, np.uint8)
    if is_dataflash(path):
        raise UsageError(f"{path} is a dataflash log of ArduPilot", "leave out the options on how to read it")
    # bytes of whole numbers are odd floating-point numbers
    with np.errstate(all="ignore"):
        tables = {_roughness(table): table for table in _tables(path.name, data)}
    if (least := min(tables, default=math.inf)) < math.inf:
        return recording_from_table(tables[least], hints)
    raise RecordingError(
        f"{path} is not a dataflash log of ArduPilot, nor of records of numbers in which gravity turns",
        f"have the program that wrote it write a table with the columns {','.join(ROLES)}, and give that",
    )


def _tables(name: str, data: NDArray[np.uint8]) -> Iterator[Table]:
    """Yield the columns of the records in a file's bytes, of each type of numbers and from each byte on."""
    some = data[:SNIFFED]
    alike = {size: float((some[size:] == some[:-size]).mean()) for size in SIZES if 2 * size <= len(some)}
    size = next((size for size in alike if alike[size] >= (1 - MOST_ODD) * max(alike.values())), 0)
    if not size:
        return
    # of a part of a stream, a byte that never changes begins the record
    fixed = (_rows(data, size) == data[:size]).all(axis=0)
    rows = _rows(data[int(fixed.argmax()) if len(data) % size else 0 :], size)
    for kind, what in TYPES.items():
        each = np.dtype(kind).itemsize
        for first in range(each):
            of_type = rows[:, first : first + (size - first) // each * each]
            numbers = np.ascontiguousarray(of_type).view(kind).astype(float).T
            # the unit of whole numbers that increase is unknown
            columns = [of for of in numbers if not is_clock(of) or ("f" in kind and is_even_clock(of))]
            remark = f"it holds records of {size} bytes, of numbers of {what}"
            yield Table(name, [f"field {i + 1}" for i in range(len(columns))], columns, remarks=(remark,))


def _rows(data: NDArray[np.uint8], size: int) -> NDArray[np.uint8]:
    return data[: len(data) // size * size].reshape(-1, size)


def _roughness(table: Table) -> float:
    """Return by how much accelerations jump from sample to sample, over their size; infinite if gravity does not turn.

    Bytes of two numbers that are read as one jump.
    """
    of = measured(table)
    triples = [np.column_stack([of[roles[role]] for role in ROLES[1:4]]) for roles in side_by_side(of)]
    jumps = [np.abs(np.diff(acc, axis=0)).mean() / typical_size(acc)[0] for acc in triples]
    return float(np.mean(jumps)) if jumps else math.inf
