"""Tables of text: the columns t [s], ax, ay, az [m/s^2], gx, gy, gz [rad/s], and temperature_c where it is known.

If the time of day is known, the column utc_s is t in seconds since 1970; a float64 resolves it to 0.2 us.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from decimal import Decimal
from io import StringIO
from pathlib import Path

import numpy as np

from ..arguments import reading
from ..clocks import S
from ..clocks.stamps import FEWEST
from ..data import Samples, Vector
from ..disk.atomic import atomic_file
from ..errors import RecordingError
from ._text import lines, numbers
from .hints import ROLES
from .reading import LONGEST_LINE
from .rows import Rows, Write, check_runs
from .tables.names import TEMPERATURE, Column, ignored_sensors, parse_header, plausible_celsius
from .tables.text import decode_text, read_table
from .tables.times import GAP_S, go_on, in_order, plausible_utc_ns

UTC = "utc_s"
# 1 on each line of samples that mpucal calibrated
CALIBRATED = "calibrated_by_mpucal"
ALL = (*ROLES, TEMPERATURE)
# bytes that are parsed at once, some 16000 lines
BLOCK = 1 << 21
_REMEDY = (
    f"name the columns in the first line, in any order: {','.join(ROLES)} (s, m/s^2, rad/s), or with"
    f" --columns t=NAME,ax=NAME,... or, in their order, --columns {','.join(ROLES)}"
)


def csv_rows(path: Path) -> Rows:
    """Return the samples of a table whose first line names its columns, in any order and any case.

    Other columns and empty lines are ignored.

    Raises
    ------
    RecordingError : it cannot be read, or its first line names a column twice; of bad lines when they are read.
    """
    with reading(path), path.open("rb") as file:
        begun, second = file.readline(LONGEST_LINE), file.readline(LONGEST_LINE)
    text = begun.decode("utf-8-sig", "replace")
    # a line may end with a carriage return alone
    first = StringIO(text, newline="").readline()
    header = [name.strip().lower() for name in next(csv.reader([first]), [])]
    begin = len(begun) - len(text.removeprefix(first).encode())
    places = _column_places(header, path)
    others = ignored_sensors(header, [c for c in parse_header(header) if c.name in places])
    interrupted: list[float] = []
    return Rows(
        check_runs(_go_on(_runs(path, begin, header, places), interrupted), path.name),
        name=path.name,
        utc_ns=_utc_ns(header, second),
        taken=f"{path.name}: {others}." if others else None,
        done=f"as its column {CALIBRATED} says" if CALIBRATED in header else "",
        plain=True,
        interrupted=interrupted,
    )


def _go_on(runs: Iterator[Samples], interrupted: list[float]) -> Iterator[Samples]:
    """Yield the runs with times that continue where a logger restarted, and add when it did to `interrupted`.

    A sample that came late gets a time between its neighbours'.
    """
    count, back, last, end, shift = 0, 0, -np.inf, -np.inf, 0.0
    for samples in runs:
        back += int(np.count_nonzero(np.diff(samples.t, prepend=last) < 0.0))
        t, restarts = go_on(samples.t, last)
        count, last, t = count + len(t), float(samples.t[-1]), t + shift
        shift = float(t[-1]) - last
        t = in_order(t, np.arange(len(t)), end) if back and np.isfinite(t).all() else t
        end = float(t[-1])
        before = np.append(t[:1] - GAP_S, t[:-1])[restarts]
        interrupted += before.tolist()
        # other times are in no order
        yield replace(samples, t=t, gap=samples.gap | restarts) if back * FEWEST <= count else samples


def _utc_ns(header: list[str], second: bytes) -> int | None:
    """Return the time of day at t = 0 by the line below the header; None if the column is missing or not a number."""
    cells = second.decode(errors="replace").split(",")
    if UTC not in header or len(cells) != len(header):
        return None
    try:
        utc_s, t = (Decimal(cells[header.index(name)].strip()) for name in (UTC, "t"))
        return plausible_utc_ns(round((utc_s - t) * S))
    except (ArithmeticError, ValueError):
        return None


def _column_places(header: list[str], path: Path) -> dict[str, int]:
    """Return column name -> place, for the columns that are read."""
    warm = [c.name for c in parse_header(header) if c.quantity == TEMPERATURE]
    wanted = (*ROLES, *sorted(warm, key=TEMPERATURE.__ne__)[:1])
    twice = [name for name in wanted if header.count(name) > 1]
    if twice:
        raise RecordingError(f"{path}: its first line names {', '.join(twice)} twice", _REMEDY)
    return {name: header.index(name) for name in wanted}


def _runs(path: Path, begin: int, header: list[str], places: dict[str, int]) -> Iterator[Samples]:
    """Yield the samples in the lines from byte `begin` on, a block at a time; `places` maps column name to cell."""
    line = 1
    for block in _blocks(path, begin):
        values = numbers(block, len(header), list(places.values()))
        values = _parse_slowly(block, path, header, places, line) if values is None else values
        line += block.count(b"\n")
        if len(values):
            yield _samples(values, sure=TEMPERATURE in places)


def _parse_slowly(block: bytes, path: Path, header: list[str], places: dict[str, int], above: int) -> Vector:
    """Return (n, 7 or 8) numbers of lines of which some lack cells, or hold what only Python reads.

    Raises
    ------
    RecordingError : too many cells are not numbers; the message names a line; `above` lines are before the block.
    """
    table = read_table(decode_text(block, path.name), str(path), header, 0, ",")
    table = replace(table, lines=[above + line for line in table.lines])
    values = table.numbers([Column(name, place, "") for name, place in places.items()])
    return np.asarray(values[~np.isnan(values).all(axis=1)])


def _blocks(path: Path, begin: int) -> Iterator[bytes]:
    """Yield whole lines from byte `begin` on, some BLOCK bytes at a time."""

    def next_lines() -> bytes:
        block = file.read(BLOCK) + file.readline(LONGEST_LINE)
        if block.rfind(b"\n") < len(block) - LONGEST_LINE and b"\r" not in block:
            raise RecordingError(f"{path} holds a line of more than {LONGEST_LINE >> 20} MB", "record it again")
        return block

    with reading(path), path.open("rb") as file:
        file.seek(begin)
        while block := next_lines():
            # a line break within quotation marks does not end a line
            while block.count(b'"') % 2 and len(block) <= BLOCK + LONGEST_LINE and (more := next_lines()):
                block += more
            yield block


def _samples(values: Vector, sure: bool) -> Samples:
    n = len(values)
    warm = np.full(n, np.nan)
    if values.shape[1] > len(ROLES):
        given = values[:, len(ROLES)]
        known = given if sure else plausible_celsius(given)
        warm = warm if known is None else known
    no = np.zeros(n, bool)
    return Samples(values[:, 0], values[:, 1:4], values[:, 4:7], warm, no, no, no)


class CsvText:
    """Encoder of samples as lines of text; the first line names the columns that the first samples have values of.

    Parameters
    ----------
    put : receives the text, a run of samples at a time. utc_ns : the time of day at t = 0, if known.
    calibrated : the samples are calibrated, which a column says.
    """

    def __init__(self, put: Callable[[bytes], object], utc_ns: int | None = None, *, calibrated: bool = False) -> None:
        self._put, self.utc_ns, self._calibrated = put, utc_ns, 1.0 if calibrated else np.nan
        self._columns: list[int] = []

    def write(self, samples: Samples) -> None:
        """Encode a run of samples."""
        utc_s = np.full(len(samples), np.nan) if self.utc_ns is None else samples.t + self.utc_ns / S
        calibrated = np.full(len(samples), self._calibrated)
        table: Vector = np.column_stack([samples.t, samples.acc, samples.gyr, samples.temperature_c, utc_s, calibrated])
        if not self._columns:
            self._columns = np.flatnonzero(~np.isnan(table).all(axis=0)).tolist()
            self._put(",".join((*ALL, UTC, CALIBRATED)[column] for column in self._columns).encode() + b"\n")
        self._put(lines(np.ascontiguousarray(table[:, self._columns])))


@contextmanager
def csv_file(path: Path, rows: Rows, done: str) -> Iterator[Write]:
    """Open a table; it has no column for the flat part, gaps, clipping and the sensor. See open_writer."""
    with atomic_file(path) as file:
        yield CsvText(file.write, rows.utc_ns, calibrated=bool(done)).write
