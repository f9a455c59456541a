"""Recordings as tables of text: t, ax, ay, az, gx, gy, gz. Knows no capture."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

import numpy as np

from ..data import Recording, Vector
from ..errors import RecordingError
from ..result.atomic import write_atomically

COLUMNS = ("t", "ax", "ay", "az", "gx", "gy", "gz")
TEMPERATURE = "temperature_c"
_REMEDY = f"name the columns in the first line, in any order: {','.join(COLUMNS)} (s, m/s^2, rad/s)"


def load_csv(path: str | Path) -> Recording:
    """Read a table whose first line names its columns, in any order and any case.

    `t` [s], `ax`, `ay`, `az` [m/s^2], `gx`, `gy`, `gz` [rad/s], and `temperature_c` where it is there.
    Other columns and empty lines are ignored.

    Raises
    ------
    RecordingError : the file cannot be read, or holds no recording; a bad line is named by its number.
    """
    path = Path(path)
    rows = csv.reader(StringIO(_text(path), newline=""))
    try:
        header = [name.strip().lower() for name in next(rows, [])]
        places = places_of(header, path)
        values = [numbers_of(row, places, len(header), rows.line_num, path) for row in rows if not is_empty(row)]
    except csv.Error as error:
        raise RecordingError(f"{path}: line {rows.line_num} is no line of a table ({error})", _REMEDY) from error
    if not values:
        raise RecordingError(f"{path} holds no samples", "record it again")
    table = np.array(values)
    return Recording.from_arrays(
        table[:, 0],
        table[:, 1:4],
        table[:, 4:7],
        temperature_c=table[:, 7] if TEMPERATURE in places else None,
        name=path.name,
    )


def save_csv(recording: Recording, path: str | Path) -> None:
    """Write t, acc, gyr and, where any is known, the temperature, so that the same numbers are read back.

    What a table has no column for, the flat part, gaps, clipping and the sensor, is not kept.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    names: list[str] = list(COLUMNS)
    table: Vector = np.column_stack([recording.t, recording.acc, recording.gyr])
    if np.isfinite(recording.temperature_c).any():
        names.append(TEMPERATURE)
        table = np.column_stack([table, recording.temperature_c])
    buffer = StringIO(newline="")
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(table.tolist())
    write_atomically(Path(path), buffer.getvalue().encode())


def _text(path: Path) -> str:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise RecordingError(f"cannot read {path} ({error.strerror})", "check the path and its permissions") from error
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path} is no text", _REMEDY) from error
    if not text.strip():
        raise RecordingError(f"{path} is empty", "record it again")
    return text


def places_of(header: list[str], path: Path) -> dict[str, int]:
    """Column name -> its place, for the columns that are read."""
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise RecordingError(f"{path}: its first line names no {', '.join(missing)}", _REMEDY)
    wanted = [*COLUMNS, TEMPERATURE] if TEMPERATURE in header else COLUMNS
    twice = [name for name in wanted if header.count(name) > 1]
    if twice:
        raise RecordingError(f"{path}: its first line names {', '.join(twice)} twice", _REMEDY)
    return {name: header.index(name) for name in wanted}


def is_empty(row: list[str]) -> bool:
    """Whether nothing is written in a row's cells."""
    return not any(map(str.strip, row))


def numbers_of(row: list[str], places: dict[str, int], width: int, line: int, path: Path) -> list[float]:
    """The numbers of a row in `places`' order; RecordingError names what is none by its line."""
    if len(row) != width:
        raise RecordingError(
            f"{path}: line {line} has {len(row)} values where the first line names {width}",
            "complete that line or leave it out",
        )
    numbers = []
    for name, place in places.items():
        try:
            numbers.append(float(row[place]))
        except ValueError as error:
            raise RecordingError(
                f"{path}: line {line}: {name} is {row[place]!r}, which is no number",
                "correct or leave out that line",
            ) from error
    return numbers
