"""NumPy archives: `t` [s] (n,), `acc` [m/s^2] (n, 3), `gyr` [rad/s] (n, 3), and optional arrays.

Optional are `flat`, (first, last + 1) samples that lie flat, or `flat_samples`, the number of them at the start;
`temperature_c` or `temperature`, (n,); `gap`, `acc_clipped`, `gyr_clipped`, (n,); `sensor`, a JSON object; `done`, the
processing of calibrated samples. Other keys are ignored.

An archive holds one array after the other: for runs of samples they are read side by side, and first written to
separate files.
"""

from __future__ import annotations

import json
import lzma
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryFile
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ..data import Samples, Sensor
from ..disk.atomic import atomic_file
from ..errors import RecordingError
from ..strict_json import parse_json
from .reading import check_size, reading
from .rows import ROWS, Rows, Write, check_runs, make_recording
from .tables.times import plausible_utc_ns

NEEDED = ("t", "acc", "gyr")
TEMPERATURES = ("temperature_c", "temperature")
MASKS = ("gap", "acc_clipped", "gyr_clipped")
LARGE = (*NEEDED, *TEMPERATURES, *MASKS)
DONE = "done"
UTC = "utc_ns"
# errors of zipfile, its decompressors and numpy: damaged, encrypted, of an unknown method, longer than memory
DAMAGED = (
    *(ValueError, TypeError, AttributeError, ArithmeticError, LookupError, EOFError, RuntimeError, MemoryError),
    *(SyntaxError, tokenize.TokenError, zipfile.BadZipFile, zlib.error, lzma.LZMAError),
)
_REMEDY = "give an .npz with t [s] (n,), acc [m/s^2] (n, 3) and gyr [rad/s] (n, 3)"


def npz_rows(path: Path) -> Rows:
    """Return the samples of an archive, a run at a time if it is stored by rows.

    Raises
    ------
    RecordingError : it cannot be read, or holds no recording.
    """
    with _open_archive(path) as archive:
        missing = [key for key in NEEDED if key not in archive.files]
        if missing:
            has = ", ".join(archive.files) or "nothing"
            raise RecordingError(f"{path} has no {', '.join(missing)}; it has {has}", _REMEDY)
        small = _arrays(archive, path, ("flat", "flat_samples", "sensor", DONE, UTC))
        arrays = {} if _by_rows(archive) else _arrays(archive, path, LARGE)
        size = _size(archive, LARGE)
    sensor, flat = _sensor(small, path), _flat(small, path)
    runs, taken = _runs(path), None
    if arrays:
        warm = next((arrays.pop(key) for key in TEMPERATURES if key in arrays), None)
        arrays.pop("temperature", None)
        whole = make_recording(**arrays, temperature_c=warm, sensor=sensor, name=path.name)
        runs, taken = Rows.of(whole).runs, whole.taken
    utc_ns = np.asarray(small.get(UTC, np.nan))
    return Rows(
        check_runs(runs, path.name),
        sensor,
        flat,
        name=path.name,
        done=str(small.get(DONE, "")),
        taken=taken,
        utc_ns=plausible_utc_ns(int(utc_ns)) if utc_ns.shape == () and utc_ns.dtype.kind in "iu" else None,
        plain=True,
        size=size,
    )


def _arrays(archive: Any, path: Path, keys: Sequence[str]) -> dict[str, Any]:
    """Return those arrays of `keys` that an archive holds, if they fit the memory."""
    check_size(path, _size(archive, keys))
    return {key: archive[key] for key in keys if key in archive.files}


def _size(archive: Any, keys: Sequence[str]) -> int:
    return sum(each.file_size for each in archive.zip.infolist() if each.filename.removesuffix(".npy") in keys)


@contextmanager
def _open_archive(path: Path) -> Iterator[Any]:
    """Open an archive; an error of the block becomes a RecordingError."""
    try:
        with reading(path), path.open("rb") as file:
            if not zipfile.is_zipfile(file):
                raise RecordingError(f"{path} is not a whole NumPy archive", _REMEDY)
            file.seek(0)
            # no pickles: a recording must not run code
            with np.load(file, allow_pickle=False) as archive:
                yield archive
    except DAMAGED as error:
        raise RecordingError(f"{path} is not a whole NumPy archive ({error})", _REMEDY) from error


def _flat(arrays: Mapping[str, Any], path: Path) -> tuple[int, int] | None:
    key = "flat" if "flat" in arrays else "flat_samples"
    if key not in arrays:
        return None
    try:
        values = [int(value) for value in np.atleast_1d(arrays[key]).tolist()]
        first, last = [0, *values] if key == "flat_samples" else values
    except (ValueError, TypeError, OverflowError) as error:
        raise RecordingError(
            f"{path}: {key} is {arrays[key]}",
            "give flat as (first, last + 1), or flat_samples as the number of samples that lie flat at the start",
        ) from error
    return first, last


def _sensor(arrays: Mapping[str, Any], path: Path) -> Sensor:
    if "sensor" not in arrays:
        return Sensor()
    try:
        return Sensor.of(parse_json(str(arrays["sensor"])))
    except (ValueError, AttributeError) as error:
        raise RecordingError(
            f"{path}: sensor is not a JSON object ({error})", "leave sensor out, or write it with mpucal"
        ) from error


class _Column:
    """Array of an archive, read from its beginning to its end."""

    def __init__(self, file: IO[bytes]) -> None:
        version = npy.read_magic(file)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        self.shape, self.fortran, self.dtype = read(file)
        self._file, self._width = file, int(np.prod(self.shape[1:]))

    def take(self, count: int, dtype: type) -> NDArray[Any]:
        """Return the next `count` rows."""
        data = self._file.read(count * self._width * self.dtype.itemsize)
        # too large a number becomes infinite, and a signalling NaN a quiet one; both are refused later
        with np.errstate(over="ignore", invalid="ignore"):
            return np.frombuffer(data, self.dtype).reshape(count, *self.shape[1:]).astype(dtype)


def _columns(archive: Any, stack: ExitStack) -> dict[str, _Column]:
    there = [key for key in LARGE if key in archive.files]
    return {key: _Column(stack.enter_context(archive.zip.open(f"{key}.npy"))) for key in there}


def _by_rows(archive: Any) -> bool:
    """Return True if all arrays are stored by rows in the right shapes, as nearly always."""
    with ExitStack() as stack:
        columns = _columns(archive, stack)
    n = (*columns["t"].shape, 0)[0]
    return n >= 2 and all(
        column.shape == ((n, 3) if key in ("acc", "gyr") else (n,))
        and column.dtype.kind in ("fiub" if key in MASKS else "fiu")
        and not column.fortran
        for key, column in columns.items()
    )


def _runs(path: Path) -> Iterator[Samples]:
    with _open_archive(path) as archive, ExitStack() as stack:
        columns = _columns(archive, stack)
        warm = next((columns[key] for key in TEMPERATURES if key in columns), None)
        for first in range(0, columns["t"].shape[0], ROWS):
            n = min(ROWS, columns["t"].shape[0] - first)
            run = {key: columns[key].take(n, float) for key in NEEDED}
            run |= {key: columns[key].take(n, bool) if key in columns else np.zeros(n, bool) for key in MASKS}
            yield Samples(**run, temperature_c=np.full(n, np.nan) if warm is None else warm.take(n, float))


@contextmanager
def npz_file(path: Path, rows: Rows, done: str) -> Iterator[Write]:
    """Open an uncompressed archive with all metadata; see open_writer."""
    with atomic_file(path) as file, ExitStack() as stack:
        columns = {field.name: stack.enter_context(TemporaryFile(dir=path.parent)) for field in fields(Samples)}
        count = 0

        def write(samples: Samples) -> None:
            nonlocal count
            for name, column in columns.items():
                column.write(np.ascontiguousarray(getattr(samples, name)).data)
            count += len(samples)

        yield write
        small: dict[str, Any] = {"sensor": json.dumps(asdict(rows.sensor)), DONE: done}
        small |= {} if rows.utc_ns is None else {UTC: np.int64(rows.utc_ns)}
        with zipfile.ZipFile(file, "w") as archive:
            for name, column in columns.items():
                _join(archive, name, column, count)
            for name, value in (small if rows.flat is None else small | {"flat": rows.flat}).items():
                with archive.open(f"{name}.npy", "w") as member:
                    npy.write_array(member, np.asarray(value), allow_pickle=False)


def _join(archive: zipfile.ZipFile, name: str, column: IO[bytes], count: int) -> None:
    """Copy the values in the file `column` into the archive."""
    like: NDArray[Any] = getattr(Samples.empty(), name)
    described = npy.header_data_from_array_1_0(like) | {"shape": (count, *like.shape[1:])}
    column.seek(0)
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        npy.write_array_header_1_0(member, described)
        copyfileobj(column, member)
