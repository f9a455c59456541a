"""The rows of a batch as a table of Arrow, a Parquet file and a CSV file, in the order of the paths."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ..disk.whole import whole_file
from ..errors import plain
from .row import COLUMNS, TEXTS, WHOLE

# rows that are in memory at once
GROUP = 4096
PARQUET, CSV = "results.parquet", "results.csv"
# what formulas begin with in one spreadsheet or another
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def schema() -> Any:
    """Of the table: text, whole numbers and float64, null where unknown."""
    kinds = {**dict.fromkeys(TEXTS, pa.string()), **dict.fromkeys(WHOLE, pa.int64())}
    return pa.schema([(name, kinds.get(name, pa.float64())) for name in COLUMNS])


def table_of(rows: Iterable[dict[str, Any]]) -> Any:
    """A pyarrow.Table of rows."""
    return pa.Table.from_pylist(list(rows), schema=schema())


def write(folder: Path, rows: Iterator[dict[str, Any]]) -> tuple[Path, Path]:
    """results.parquet and results.csv, a group of rows at a time.

    Raises
    ------
    OutputError : they cannot be written.
    """
    parquet, text = folder / PARQUET, folder / CSV
    with whole_file(parquet) as binary, whole_file(text) as plain, pq.ParquetWriter(binary, schema()) as writer:
        plain.write((",".join(COLUMNS) + "\n").encode())
        while group := list(islice(rows, GROUP)):
            writer.write_table(table_of(group))
            lines = _Lines()
            csv.DictWriter(lines, COLUMNS, extrasaction="ignore", lineterminator="\n").writerows(
                {key: cell(value) for key, value in row.items()} for row in group
            )
            plain.write("".join(lines.text).encode())
    return parquet, text


def cell(value: Any) -> Any:
    """A value as spreadsheets only show it: none takes a text for a formula, or turns its direction around."""
    if not isinstance(value, str):
        return value
    return plain(f"'{value}" if value.startswith(FORMULA) else value)


class _Lines:
    """What csv writes to."""

    def __init__(self) -> None:
        self.text: list[str] = []

    def write(self, text: str) -> int:
        self.text.append(text)
        return len(text)
