"""Recordings as NumPy archives: `t`, `acc`, `gyr` and what else is known. Knows no capture."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Recording, Sensor
from ..errors import RecordingError
from ..result.atomic import write_atomically

_REMEDY = "give an .npz with t [s] (n,), acc [m/s^2] (n, 3) and gyr [rad/s] (n, 3)"


def load_npz(path: str | Path) -> Recording:
    """Read an archive with the keys `t` [s] (n,), `acc` [m/s^2] (n, 3), `gyr` [rad/s] (n, 3).

    Where they are there: `flat`, (first, last + 1) samples that lie flat, or `flat_samples`, how many do
    from the first on; `temperature_c` or `temperature`, (n,); and `gap`, `acc_clipped`, `gyr_clipped`,
    `sensor` as `save_npz` writes them. Other keys are ignored.

    Raises
    ------
    RecordingError : the file cannot be read, or holds no recording.
    """
    path = Path(path)
    arrays = _arrays(path)
    missing = [key for key in ("t", "acc", "gyr") if key not in arrays]
    if missing:
        raise RecordingError(f"{path} has no {', '.join(missing)}; it has {', '.join(arrays) or 'nothing'}", _REMEDY)
    return Recording.from_arrays(
        arrays["t"],
        arrays["acc"],
        arrays["gyr"],
        flat_of(arrays, path),
        temperature_c=arrays.get("temperature_c", arrays.get("temperature")),
        gap=arrays.get("gap"),
        acc_clipped=arrays.get("acc_clipped"),
        gyr_clipped=arrays.get("gyr_clipped"),
        sensor=sensor_of(arrays, path),
        name=path.name,
    )


def save_npz(recording: Recording, path: str | Path) -> None:
    """Write a recording with all that is known of it, atomically.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    arrays: dict[str, Any] = {
        "t": recording.t,
        "acc": recording.acc,
        "gyr": recording.gyr,
        "temperature_c": recording.temperature_c,
        "gap": recording.gap,
        "acc_clipped": recording.acc_clipped,
        "gyr_clipped": recording.gyr_clipped,
        "sensor": json.dumps(asdict(recording.sensor)),
    }
    if recording.flat is not None:
        arrays["flat"] = recording.flat
    buffer = BytesIO()
    np.savez_compressed(buffer, **arrays)
    write_atomically(Path(path), buffer.getvalue())


def _arrays(path: Path) -> dict[str, Any]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"cannot read {path} ({error.strerror})", "check the path and its permissions") from error
    if not zipfile.is_zipfile(BytesIO(data)):
        raise RecordingError(f"{path} is no whole NumPy archive", _REMEDY)
    try:
        # no pickles: a recording must not run code
        with np.load(BytesIO(data), allow_pickle=False) as archive:
            return dict(archive)
    except (
        ValueError,
        TypeError,
        AttributeError,
        OSError,
        EOFError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise RecordingError(f"{path} is no whole NumPy archive ({error})", _REMEDY) from error


def flat_of(arrays: Mapping[str, Any], path: Path) -> tuple[int, int] | None:
    """(first, last + 1) samples that an archive says lie flat; RecordingError where that is nonsense."""
    key = "flat" if "flat" in arrays else "flat_samples"
    if key not in arrays:
        return None
    try:
        values = [int(value) for value in np.atleast_1d(arrays[key])]
        first, last = [0, *values] if key == "flat_samples" else values
    except (ValueError, TypeError) as error:
        raise RecordingError(
            f"{path}: {key} is {arrays[key]}",
            "give flat as (first, last + 1), or flat_samples as how many samples lie flat at the start",
        ) from error
    return first, last


def sensor_of(arrays: Mapping[str, Any], path: Path) -> Sensor:
    """What an archive says of its sensor; RecordingError where that is nonsense."""
    if "sensor" not in arrays:
        return Sensor()
    try:
        return Sensor.of(json.loads(str(arrays["sensor"])))
    except (ValueError, AttributeError) as error:
        raise RecordingError(
            f"{path}: sensor is no JSON object ({error})", "leave sensor out, or write it with mpucal"
        ) from error
