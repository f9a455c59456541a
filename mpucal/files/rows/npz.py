"""NumPy archives, a run of samples at a time. Knows no other kind of file.

An archive holds one array after the other: they are read side by side, and written to files of their own first.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryFile
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ...data import Samples
from ...errors import RecordingError
from ...result.atomic import whole_file
from ..npz import flat_of, load_npz, sensor_of
from . import ROWS, Rows, Write, cannot_read, checked

DONE = "done"
SMALL = ("flat", "flat_samples", "sensor", DONE)
TEMPERATURES = ("temperature_c", "temperature")
MASKS = ("gap", "acc_clipped", "gyr_clipped")
COPIED = 1 << 20


class _Column:
    """One array of the archive, read from its beginning to its end."""

    def __init__(self, file: IO[bytes]) -> None:
        version = npy.read_magic(file)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        self.shape, self.fortran, self.dtype = read(file)
        self._file, self._width = file, int(np.prod(self.shape[1:]))

    def take(self, count: int) -> NDArray[Any]:
        """The next `count` rows."""
        data = self._file.read(count * self._width * self.dtype.itemsize)
        return np.frombuffer(data, self.dtype).reshape(count, *self.shape[1:])


def npz_rows(path: Path) -> Rows:
    """The samples of an archive, whose keys are those of load_npz.

    Raises
    ------
    RecordingError : it cannot be read, or holds no recording.
    """
    try:
        with zipfile.ZipFile(path) as archive, np.load(path, allow_pickle=False) as arrays:
            small = {key: arrays[key] for key in SMALL if key in arrays.files}
            streamed = _streamed(archive)
    except OSError as error:
        raise cannot_read(path, error) from error
    except (ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path} is no whole NumPy archive ({error})", "give a whole .npz") from error
    done = str(small[DONE]) if DONE in small else ""
    if not streamed:
        recording = load_npz(path)
        runs = (recording.part(first, first + ROWS) for first in range(0, len(recording), ROWS))
        return Rows(runs, recording.sensor, recording.flat, name=recording.name, done=done)
    return Rows(
        checked(_runs(path), path.name), sensor_of(small, path), flat_of(small, path), name=path.name, done=done
    )


def _streamed(archive: zipfile.ZipFile) -> bool:
    """Whether its arrays lie there by rows, as they nearly always do; what is odd or wrong is load_npz's."""
    shapes = {}
    for key in ("t", "acc", "gyr", *TEMPERATURES, *MASKS):
        if f"{key}.npy" not in archive.namelist():
            continue
        with archive.open(f"{key}.npy") as file:
            column = _Column(file)
        if column.fortran or column.dtype.kind not in ("fiub" if key in MASKS else "fiu"):
            return False
        shapes[key] = column.shape
    if not {"t", "acc", "gyr"} <= shapes.keys() or len(shapes["t"]) != 1:
        return False
    n = shapes["t"][0]
    return n >= 2 and all(shape == ((n, 3) if key in ("acc", "gyr") else (n,)) for key, shape in shapes.items())


def _runs(path: Path) -> Iterator[Samples]:
    try:
        with ExitStack() as stack:
            archive = stack.enter_context(zipfile.ZipFile(path))
            names = set(archive.namelist())

            def column(*keys: str) -> _Column | None:
                key = next((key for key in keys if f"{key}.npy" in names), None)
                return None if key is None else _Column(stack.enter_context(archive.open(f"{key}.npy")))

            t, acc, gyr = (_Column(stack.enter_context(archive.open(f"{key}.npy"))) for key in ("t", "acc", "gyr"))
            warm, masks = column(*TEMPERATURES), [column(key) for key in MASKS]
            for first in range(0, t.shape[0], ROWS):
                n = min(ROWS, t.shape[0] - first)
                yield Samples(
                    t.take(n).astype(float),
                    acc.take(n).astype(float),
                    gyr.take(n).astype(float),
                    np.full(n, np.nan) if warm is None else warm.take(n).astype(float),
                    *(np.zeros(n, bool) if mask is None else mask.take(n).astype(bool) for mask in masks),
                )
    except OSError as error:
        raise cannot_read(path, error) from error
    except (ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path} is no whole NumPy archive ({error})", "give a whole .npz") from error


@contextmanager
def npz_file(path: Path, rows: Rows, done: str) -> Iterator[Write]:
    """An archive, not compressed, with the keys that load_npz reads, and `done`; see open_writer."""
    with ExitStack() as stack, whole_file(path) as file:
        columns = {field.name: stack.enter_context(TemporaryFile(dir=path.parent)) for field in fields(Samples)}
        count = 0

        def write(samples: Samples) -> None:
            nonlocal count
            for name, column in columns.items():
                column.write(np.ascontiguousarray(getattr(samples, name)).data)
            count += len(samples)

        yield write
        small = {"sensor": json.dumps(asdict(rows.sensor)), DONE: done}
        with zipfile.ZipFile(file, "w") as archive:
            for name, column in columns.items():
                _join(archive, name, column, count)
            for name, value in (small if rows.flat is None else small | {"flat": rows.flat}).items():
                with archive.open(f"{name}.npy", "w") as member:
                    npy.write_array(member, np.asarray(value), allow_pickle=False)


def _join(archive: zipfile.ZipFile, name: str, column: IO[bytes], count: int) -> None:
    """Put what was written to `column` into the archive."""
    like: NDArray[Any] = getattr(Samples.empty(), name)
    described = npy.header_data_from_array_1_0(like) | {"shape": (count, *like.shape[1:])}
    column.seek(0)
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        npy.write_array_header_1_0(member, described)
        copyfileobj(column, member, COPIED)
