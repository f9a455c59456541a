"""Tables of text, a run of samples at a time. Knows no other kind of file."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO, TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np

from ...data import Samples, Vector
from ...errors import RecordingError
from ...files import whole_file
from ..csv import COLUMNS, TEMPERATURE, numbers_of, places_of
from . import ROWS, Rows, Write, cannot_read

ALL = (*COLUMNS, TEMPERATURE)


def csv_rows(path: Path) -> Rows:
    """The samples of a table, whose columns are those of load_csv.

    Raises
    ------
    RecordingError : it cannot be read, or its first line names no such columns.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            header = [name.strip().lower() for name in next(csv.reader([file.readline()]), [])]
    except OSError as error:
        raise cannot_read(path, error) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path} is no table of text ({error})", "give one whose first line is text") from error
    return Rows(_runs(path, header, places_of(header, path)), name=path.name)


def _runs(path: Path, header: list[str], places: dict[str, int]) -> Iterator[Samples]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            line = 1 + len(list(islice(file, 1)))
            while lines := list(islice(file, ROWS)):
                values = _values(lines, header, places, line, path)
                line += len(lines)
                if len(values):
                    yield _samples(values)
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path} is no text from line {line} on", "record it again") from error
    except OSError as error:
        raise cannot_read(path, error) from error


def _values(lines: list[str], header: list[str], places: dict[str, int], line: int, path: Path) -> Vector:
    """(n, 7 or 8) numbers of lines, the first of which is number `line`."""
    full = [text for text in lines if not text.isspace()]
    if not full:
        return np.zeros((0, len(places)))
    try:
        return np.loadtxt(full, delimiter=",", comments=None, usecols=list(places.values()), ndmin=2, quotechar='"')
    except ValueError:
        # the slow way, which skips what load_csv does, and names a bad line
        rows = csv.reader(lines)
        values = [numbers_of(row, places, len(header), line + rows.line_num - 1, path) for row in rows if any(row)]
        return np.array(values).reshape(-1, len(places))


def _samples(values: Vector) -> Samples:
    n = len(values)
    warm = values[:, 7] if values.shape[1] > 7 else np.full(n, np.nan)
    no = np.zeros(n, bool)
    return Samples(values[:, 0], values[:, 1:4], values[:, 4:7], warm, no, no, no)


class CsvText:
    """Samples as lines of text, under a first line that names the columns: of what the first samples know."""

    def __init__(self, file: IO[str]) -> None:
        self._file = file
        self._columns: list[str] = []

    def write(self, samples: Samples) -> None:
        """Take a run of samples."""
        buffer = StringIO(newline="")
        writer = csv.writer(buffer, lineterminator="\n")
        table: Vector = np.column_stack([samples.t, samples.acc, samples.gyr, samples.temperature_c])
        if not self._columns:
            known = np.flatnonzero(~np.isnan(table).all(axis=0))
            self._columns = [ALL[i] for i in known]
            writer.writerow(self._columns)
        writer.writerows(table[:, [ALL.index(name) for name in self._columns]].tolist())
        self._file.write(buffer.getvalue())


@contextmanager
def csv_file(path: Path) -> Iterator[Write]:
    """A table as a file; see open_writer."""
    with whole_file(path) as file:
        text = TextIOWrapper(file, encoding="utf-8", newline="")
        try:
            yield CsvText(text).write
        finally:
            # the file is whole_file's to close
            text.detach()
