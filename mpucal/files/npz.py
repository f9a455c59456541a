"""NumPy archives: `t` [s] (n,), `acc` [m/s^2] (n, 3), `gyr` [rad/s] (n, 3), and optional arrays.

Optional are `flat`, (first, last + 1) samples that lie flat, or `flat_samples`, the number of them at the start;
`temperature_c` or `temperature`, (n,); `gap`, `acc_clipped`, `gyr_clipped`, (n,); `interrupted`, times [s] as of a
Recording; `sensor`, a JSON object; `done`, the processing of calibrated samples. Other keys are ignored.
"""

from __future__ import annotations

import json
import tokenize
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import is_plausible
from ..data import Samples, Sensor
from ..disk.atomic import atomic_file
from ..errors import RecordingError
from ..strict_json import parse_json
from .reading import DAMAGED_ZIP, check_size, whole
from .rows import Rows, Write, check_runs, make_recording, shown_units
from .tables.times import plausible_utc_ns

NEEDED = ("t", "acc", "gyr")
TEMPERATURES = ("temperature_c", "temperature")
MASKS = ("gap", "acc_clipped", "gyr_clipped")
DONE, UTC, INTERRUPTED = "done", "utc_ns", "interrupted"
READ = (*NEEDED, *TEMPERATURES, *MASKS, "flat", "flat_samples", "sensor", DONE, UTC, INTERRUPTED)
# also errors of numpy: damaged, encrypted, longer than memory
DAMAGED = (
    *(*DAMAGED_ZIP, TypeError, AttributeError, ArithmeticError, LookupError, MemoryError, SyntaxError),
    tokenize.TokenError,
)
_REMEDY = "give an .npz with t [s] (n,), acc [m/s^2] (n, 3) and gyr [rad/s] (n, 3)"


def npz_rows(path: Path) -> Rows:
    """Return the samples of an archive, which is loaded whole.

    Raises
    ------
    RecordingError : it cannot be read, or holds no recording.
    """
    with _open_archive(path) as archive:
        missing = [key for key in NEEDED if key not in archive.files]
        if missing:
            has = ", ".join(archive.files) or "nothing"
            raise RecordingError(f"{path} has no {', '.join(missing)}; it has {has}", _REMEDY)
        check_size(path, sum(each.file_size for each in archive.zip.infolist() if each.filename[:-4] in READ))
        arrays = {key: archive[key] for key in READ if key in archive.files}
        interrupted = np.ravel(arrays.get(INTERRUPTED, [])).astype(float).tolist()
    columns = {key: arrays[key] for key in (*NEEDED, *MASKS) if key in arrays}
    columns |= {key: _with_nan(columns[key]) for key in ("acc", "gyr")}
    warm = next((arrays[key] for key in TEMPERATURES if key in arrays), None)
    sensor, flat = _sensor(arrays, path), _flat(arrays, path)
    whole = make_recording(**columns, temperature_c=warm, flat=flat, sensor=sensor, name=path.name)
    units, utc_ns = shown_units([whole], sensor), np.asarray(arrays.get(UTC, np.nan))
    rows = Rows.of(whole, str(arrays.get(DONE, ""))).in_si(units)
    return replace(
        rows,
        runs=check_runs(rows.runs, path.name),
        interrupted=interrupted,
        utc_ns=plausible_utc_ns(int(utc_ns)) if utc_ns.shape == () and utc_ns.dtype.kind in "iu" else None,
    )


@contextmanager
def _open_archive(path: Path) -> Iterator[Any]:
    """Open an archive; an error of the block becomes a RecordingError."""
    with whole(path, "NumPy archive", _REMEDY, DAMAGED), path.open("rb") as file:
        if not zipfile.is_zipfile(file):
            raise RecordingError(f"{path} is not a whole NumPy archive", _REMEDY)
        file.seek(0)
        # no pickles: a recording must not run code
        with np.load(file, allow_pickle=False) as archive:
            yield archive


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


def _with_nan(values: Any) -> Any:
    """Return numbers with NaN in place of those that no sensor gives; anything else as it is."""
    if values.dtype.kind not in "fiu":
        return values
    # too large a number becomes infinite, and a signalling NaN a quiet one
    with np.errstate(over="ignore", invalid="ignore"):
        found = values.astype(float)
    found[~is_plausible(found)] = np.nan
    return found


@contextmanager
def npz_file(path: Path, rows: Rows, done: str) -> Iterator[Write]:
    """Open an uncompressed archive with all metadata, written whole at the end; see open_writer."""
    with atomic_file(path) as file:
        runs: list[Samples] = []
        yield runs.append
        known: dict[str, Any] = {"flat": rows.flat, UTC: rows.utc_ns, INTERRUPTED: rows.interrupted or None}
        small = {key: value for key, value in known.items() if value is not None}
        sensor = json.dumps(asdict(rows.sensor))
        np.savez(file, **vars(Samples.joined(runs)), **small, sensor=sensor, done=done)
