"""Tables of text, a run of samples at a time. Knows no other kind of file."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path

import numpy as np

from ...data import Samples, Vector
from ...errors import RecordingError
from ...result.atomic import whole_file
from ..csv import COLUMNS, TEMPERATURE, is_empty, numbers_of, places_of
from . import Rows, Write, cannot_read, checked
from ._text import lines, numbers

ALL = (*COLUMNS, TEMPERATURE)
# some 16000 lines
BLOCK = 1 << 21


def csv_rows(path: Path) -> Rows:
    """The samples of a table, whose columns are those of load_csv.

    Raises
    ------
    RecordingError : it cannot be read, or its first line names no such columns.
    """
    try:
        with path.open("rb") as file:
            begun = file.readline()
        text = begun.decode("utf-8-sig")
        # a line may end with a carriage return alone
        first = StringIO(text, newline="").readline()
        header = [name.strip().lower() for name in next(csv.reader([first]), [])]
    except OSError as error:
        raise cannot_read(path, error) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path} is no table of text ({error})", "give one whose first line is text") from error
    begin = len(begun) - len(text.removeprefix(first).encode())
    return Rows(checked(_runs(path, begin, header, places_of(header, path)), path.name), name=path.name)


def _runs(path: Path, begin: int, header: list[str], places: dict[str, int]) -> Iterator[Samples]:
    try:
        with path.open("rb") as file:
            file.seek(begin)
            line = 2
            while block := file.read(BLOCK) + file.readline():
                values = numbers(block, len(header), list(places.values()))
                if values is None:
                    values = _odd(block, header, places, line, path)
                line += block.count(b"\n")
                if len(values):
                    yield _samples(values)
    except OSError as error:
        raise cannot_read(path, error) from error


def _odd(block: bytes, header: list[str], places: dict[str, int], line: int, path: Path) -> Vector:
    """(n, 7 or 8) numbers of lines, the first of which is number `line`: slowly all that load_csv takes.

    Raises
    ------
    RecordingError : what is no number is named by its line.
    """
    try:
        text = block.decode()
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path} is no text from line {line} on", "record it again") from error
    rows = csv.reader(StringIO(text, newline=""))
    values = [numbers_of(row, places, len(header), line + rows.line_num - 1, path) for row in rows if not is_empty(row)]
    return np.array(values).reshape(-1, len(places))


def _samples(values: Vector) -> Samples:
    n = len(values)
    warm = values[:, 7] if values.shape[1] > 7 else np.full(n, np.nan)
    no = np.zeros(n, bool)
    return Samples(values[:, 0], values[:, 1:4], values[:, 4:7], warm, no, no, no)


class CsvText:
    """Samples as lines of text, under a first line that names the columns: of what the first samples know.

    Parameters
    ----------
    put : takes the text, a run of samples at a time.
    """

    def __init__(self, put: Callable[[bytes], object]) -> None:
        self._put = put
        self._columns: list[int] = []

    def write(self, samples: Samples) -> None:
        """Take a run of samples."""
        table: Vector = np.column_stack([samples.t, samples.acc, samples.gyr, samples.temperature_c])
        if not self._columns:
            self._columns = np.flatnonzero(~np.isnan(table).all(axis=0)).tolist()
            self._put(",".join(ALL[column] for column in self._columns).encode() + b"\n")
        self._put(lines(np.ascontiguousarray(table[:, self._columns])))


@contextmanager
def csv_file(path: Path) -> Iterator[Write]:
    """A table as a file; see open_writer."""
    with whole_file(path) as file:
        yield CsvText(file.write).write
