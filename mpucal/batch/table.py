"""The rows of a batch as a table of Arrow, a Parquet file and a CSV file."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ..disk.atomic import atomic_file
from ..errors import escape_controls
from .row import COLUMNS, TEXTS, WHOLE

# rows in memory at once
GROUP = 4096
PARQUET, CSV = "results.parquet", "results.csv"
# beginnings of formulas in various spreadsheets
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def schema() -> Any:
    """Return the schema of the table: text, whole numbers and float64, null if unknown."""
    kinds = {**dict.fromkeys(TEXTS, pa.string()), **dict.fromkeys(WHOLE, pa.int64())}
    return pa.schema([(name, kinds.get(name, pa.float64())) for name in COLUMNS])


def make_table(rows: Iterable[dict[str, Any]]) -> Any:
    """Return a pyarrow.Table of rows."""
    return pa.Table.from_pylist(list(rows), schema=schema())


def write_tables(folder: Path, rows: Iterator[dict[str, Any]]) -> tuple[Path, Path]:
    """Write results.parquet and results.csv, a group of rows at a time.

    Raises
    ------
    OutputError : they cannot be written.
    """
    parquet, text = folder / PARQUET, folder / CSV
    with atomic_file(parquet) as binary, atomic_file(text) as plain, pq.ParquetWriter(binary, schema()) as writer:
        plain.write((",".join(COLUMNS) + "\n").encode())
        while group := list(islice(rows, GROUP)):
            writer.write_table(make_table(group))
            lines = StringIO()
            csv.DictWriter(lines, COLUMNS, extrasaction="ignore", lineterminator="\n").writerows(
                {key: escape_cell(value) for key, value in row.items()} for row in group
            )
            plain.write(lines.getvalue().encode())
    return parquet, text


def escape_cell(value: Any) -> Any:
    """Return a value that a spreadsheet only shows: not a formula, and without characters that change its direction."""
    if not isinstance(value, str):
        return value
    return escape_controls(f"'{value}" if value.startswith(FORMULA) else value)
