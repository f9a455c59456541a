"""One recording as a row of the table: read, calibrated and put into numbers where the worker is.

Units are those of calibration.json: m/s^2, rad/s, degrees Celsius, s.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from .. import __version__
from ..data import Recording
from ..disk.whole import write_atomically
from ..errors import MpucalError, OutputError, RecordingError
from ..files import load
from ..files.hints import NO_HINTS, Hints
from ..mavlink.calibrate_vehicle import calibrate_vehicle
from ..report import render
from ..result.calibration import Calibration

AXES = "xyz"
TEXTS = ("path", "batch", "digest", "sensor", "recorded", "chip", "model", "verdict", "reasons", "report", "error")
WHOLE = ("who_am_i", "samples")
MATRICES = ("D", "D_std", "K", "K_std")
VECTORS = ("b_a", "b_a_std", "b_omega", "b_omega_std")
SCALARS = ("accel_range_g", "gyro_range_dps", "rate_hz", "temperature_c", "seconds", "gravity", "nis")
NUMBERS = (
    *SCALARS,
    *(f"{name}_{i}{j}" for name in MATRICES for i in AXES for j in AXES),
    *(f"{name}_{i}" for name in VECTORS for i in AXES),
)
COLUMNS = (*TEXTS, *WHOLE, *NUMBERS)

# a row's report is named by so many digits of its digest
REPORT_DIGITS = 16


@dataclass(frozen=True)
class Settings:
    """How each recording is read and calibrated, see mpucal.load and mpucal.calibrate.

    Attributes
    ----------
    reports : the folder for a page of each, or empty. hints : of files that no pattern of `by_pattern` names.
    """

    model: str
    gravity: float
    gravity_anyway: bool = False
    reports: str = ""
    hints: Hints = NO_HINTS
    by_pattern: tuple[tuple[str, Hints], ...] = ()

    @property
    def key(self) -> str:
        """What a row depends on besides its file."""
        said = f" {self.hints} {self.by_pattern}" if self.hints != NO_HINTS or self.by_pattern else ""
        return f"{__version__} {self.model} {self.gravity!r} {self.gravity_anyway} {bool(self.reports)}{said}"

    def hints_of(self, path: str) -> Hints:
        """The hints for a file: those of the first pattern that its path or its name matches."""
        names = (path, PurePosixPath(path).name)
        fitting = (hints for pattern, hints in self.by_pattern if any(fnmatch(name, pattern) for name in names))
        return next(fitting, self.hints)


def rows_of(paths: Sequence[str], settings: Settings, known: Sequence[str | None]) -> list[dict[str, Any]]:
    """The rows of several, see row_of."""
    return [row_of(path, settings, digest) for path, digest in zip(paths, known, strict=True)]


def row_of(path: str, settings: Settings, known: str | None = None) -> dict[str, Any]:
    """The row of a file, a folder or a URL; whatever is wrong with that is in its column `error`.

    With the digest `known` only {"path", "digest"}: this file's row is there already.
    """
    row: dict[str, Any] = {"path": path, "batch": PurePosixPath(path).parent.name}
    local = None
    try:
        with fetched(path) as local:
            row["digest"] = digest_of(local)
            if row["digest"] == known:
                return {"path": path, "digest": known}
            recording = load(local, settings.hints_of(path))
            calibration = calibrate_vehicle(
                recording, model=settings.model, gravity=settings.gravity, gravity_anyway=settings.gravity_anyway
            )
            row |= numbers_of(calibration, recording)
            if settings.reports:
                row["report"] = f"{row['digest'][:REPORT_DIGITS]}.html"
                put(f"{settings.reports}/{row['report']}", render(calibration, recording).encode())
    except MpucalError as error:
        row["error"] = str(error).replace(str(local), path)
    except Exception as error:
        # one file must not end the other ten thousand
        row["error"] = f"a bug in mpucal, please report it: {type(error).__name__}: {error}"
    return row


def numbers_of(calibration: Calibration, recording: Recording) -> dict[str, Any]:
    """What a row says of a calibration; what is unknown is left out."""
    sensor, quality, fit = calibration.sensor, calibration.quality, calibration.fit
    seconds = float(recording.t[-1] - recording.t[0])
    row: dict[str, Any] = {
        "chip": sensor.chip,
        "who_am_i": sensor.who_am_i,
        "sensor": trim_of(recording),
        "recorded": recorded_of(recording),
        "model": fit.get("model"),
        "verdict": calibration.verdict,
        "reasons": " ".join(dict.fromkeys(reason["code"] for reason in quality.get("reasons", ()))),
        "samples": len(recording),
        "seconds": seconds,
        "gravity": fit.get("gravity"),
        "nis": fit.get("nis"),
    }
    for name in ("accel_range_g", "gyro_range_dps", "rate_hz", "temperature_c"):
        row[name] = getattr(sensor, name)
    for name in MATRICES:
        matrix = np.asarray(getattr(calibration, name), float)
        row |= {f"{name}_{a}{b}": float(matrix[i, j]) for i, a in enumerate(AXES) for j, b in enumerate(AXES)}
    for name in VECTORS:
        row |= {f"{name}_{a}": float(getattr(calibration, name)[i]) for i, a in enumerate(AXES)}
    numbers = (*WHOLE, *NUMBERS)
    return {
        key: value
        for key, value in row.items()
        if value is not None and (key not in numbers or np.isfinite(float(value)))
    }


def trim_of(recording: Recording) -> str | None:
    """The factory's trim of the accelerometer, by which a sensor is known again; None where it is not known."""
    words = recording.sensor.accel_offsets
    if words is None or not any(words):
        return None
    return "-".join(f"{word & 0xFFFF:04x}" for word in words)


def recorded_of(recording: Recording) -> str | None:
    """When it was recorded, ISO 8601."""
    if recording.utc_ns is None:
        return None
    began_s = recording.utc_ns * 1e-9 + float(recording.t[0])
    return datetime.fromtimestamp(round(began_s), UTC).isoformat()


@contextmanager
def fetched(path: str) -> Iterator[Path]:
    """The file here: itself, or what a URL of fsspec names, in a temporary file."""
    if "://" not in path:
        yield Path(path)
        return
    import fsspec  # noqa: PLC0415

    with TemporaryDirectory(prefix="mpucal-") as folder:
        # a signed URL goes on behind the name
        local = Path(folder) / PurePosixPath(path.partition("?")[0]).name
        try:
            system, there = fsspec.core.url_to_fs(path)
            if system.isdir(there):
                system.get(there, str(local), recursive=True)
            else:
                # get would take a signed URL's question mark for a pattern
                system.get_file(there, str(local))
        except Exception as error:
            do = lacking(path) if isinstance(error, ImportError) else "check it, and that this worker may read it"
            raise RecordingError(f"cannot fetch {path} ({type(error).__name__}: {error})", do) from error
        yield local


def lacking(url: str) -> str:
    """What to do where fsspec has no package for a URL."""
    scheme = url.partition("://")[0].removesuffix("s") if url.startswith("http") else url.partition("://")[0]
    return f"pip install 'fsspec[{scheme}]', here and where the workers are"


def digest_of(path: Path) -> str:
    """SHA-256 of a file; of a folder, of its captures or else of all its files, by name.

    Raises
    ------
    RecordingError : it cannot be read.
    """
    digest = hashlib.sha256()
    try:
        files = [path]
        if path.is_dir():
            files = sorted(each for each in path.rglob("*") if each.is_file())
            files = [each for each in files if each.stem.startswith("capture")] or files
        for each in files:
            with each.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
    except OSError as error:
        raise RecordingError(f"cannot read {path} ({error.strerror or error})", "check the path") from error
    return digest.hexdigest()


def put(place: str, data: bytes) -> None:
    """Write a file or URL.

    Raises
    ------
    OutputError : it cannot be written.
    """
    try:
        if "://" not in place:
            write_atomically(Path(place), data)
            return
        import fsspec  # noqa: PLC0415

        with fsspec.open(place, "wb") as file:
            file.write(data)
    except OSError as error:
        raise OutputError(f"cannot write {place} ({error})", "choose another place with -o") from error
