"""Row of the table for one recording, read and calibrated by a worker.

Units are those of calibration.json: m/s^2, rad/s, degrees Celsius, s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from .. import __version__
from ..data import AXES, Recording
from ..disk.atomic import write_atomically
from ..errors import MpucalError
from ..files import load
from ..files.hints import NO_HINTS, Hints
from ..mavlink.parameters.document import calibrate_vehicle
from ..report import render
from ..result.calibration import Calibration
from .locations import compute_digest, fetch

TEXTS = (
    "path",
    "batch",
    "digest",
    "sensor",
    "recorded",
    "chip",
    "model",
    "verdict",
    "reasons",
    "report",
    "error",
    "options",
)
WHOLE = ("who_am_i", "samples")
MATRICES = ("D", "D_std", "K", "K_std")
VECTORS = ("b_a", "b_a_std", "b_omega", "b_omega_std")
SCALARS = ("accel_range_g", "gyro_range_dps", "rate_hz", "temperature_c", "seconds", "gravity", "nis")
# column -> array of a calibration, and place in it
ELEMENTS = {
    f"{name}_{''.join(AXES[i] for i in at)}": (name, at)
    for names, shape in ((MATRICES, (3, 3)), (VECTORS, (3,)))
    for name in names
    for at in np.ndindex(shape)
}
NUMBERS = (*SCALARS, *ELEMENTS)
COLUMNS = (*TEXTS, *WHOLE, *NUMBERS)


@dataclass(frozen=True)
class Settings:
    """Settings for reading and calibrating each recording; see mpucal.load and mpucal.calibrate.

    Attributes
    ----------
    reports : the folder for their reports, or empty. hints : for files that match no pattern of `by_pattern`.
    """

    model: str
    gravity: float
    gravity_anyway: bool = False
    reports: str = ""
    hints: Hints = NO_HINTS
    by_pattern: tuple[tuple[str, Hints], ...] = ()

    def key(self, path: str) -> str:
        """Return a text that identifies all that the row of a file depends on besides the file."""
        hints = "" if (found := self.find_hints(path)) == NO_HINTS else f" {found}"
        return f"{__version__} {self.model} {self.gravity!r} {self.gravity_anyway} {bool(self.reports)}{hints}"

    def find_hints(self, path: str) -> Hints:
        """Return the hints for a file: those of the first pattern that its path or name matches."""
        names = (path, PurePosixPath(path).name)
        fitting = (hints for pattern, hints in self.by_pattern if any(fnmatch(name, pattern) for name in names))
        return next(fitting, self.hints)


def make_rows(paths: Sequence[str], settings: Settings, known: Sequence[str | None]) -> list[dict[str, Any]]:
    """Return the rows of several recordings; see make_row."""
    return [make_row(path, settings, digest) for path, digest in zip(paths, known, strict=True)]


def make_row(path: str, settings: Settings, known: str | None = None) -> dict[str, Any]:
    """Return the row of a file, a folder or a URL, with any error in the column `error`.

    If its digest is `known`, its row exists already, and only {"path", "digest"} is returned.
    """
    row: dict[str, Any] = {"path": path, "batch": PurePosixPath(path).parent.name}
    local = None
    try:
        with fetch(path) as local:
            row["digest"] = compute_digest(local)
            if row["digest"] == known:
                return {"path": path, "digest": known}
            recording = load(local, settings.find_hints(path))
            calibration = calibrate_vehicle(
                recording, model=settings.model, gravity=settings.gravity, gravity_anyway=settings.gravity_anyway
            )
            row |= _numbers(calibration, recording)
            if settings.reports:
                row["report"] = f"{row['digest'][:16]}.html"
                write_atomically(Path(settings.reports, row["report"]), render(calibration, recording).encode())
    except MpucalError as error:
        row["error"] = str(error).replace(str(local), path)
        row |= {"options": error.options} if error.options else {}
    except Exception as error:
        # one file must not end a batch of ten thousand
        row["error"] = f"a bug in mpucal, please report it: {type(error).__name__}: {error}"
    return row


def _numbers(calibration: Calibration, recording: Recording) -> dict[str, Any]:
    """Return the columns of a calibration, without unknown values."""
    sensor, quality, fit = calibration.sensor, calibration.quality, calibration.fit
    seconds = float(recording.t[-1] - recording.t[0])
    row: dict[str, Any] = {
        "chip": sensor.chip,
        "who_am_i": sensor.who_am_i,
        "sensor": _factory_trim(recording),
        "recorded": _recording_time(recording),
        "model": fit.get("model"),
        "verdict": calibration.verdict,
        "reasons": " ".join(dict.fromkeys(reason["code"] for reason in quality.get("reasons", ()))),
        "samples": len(recording),
        "seconds": seconds,
        "gravity": fit.get("gravity"),
        "nis": fit.get("nis"),
    }
    row |= {name: getattr(sensor, name) for name in ("accel_range_g", "gyro_range_dps", "rate_hz", "temperature_c")}
    row |= {column: float(getattr(calibration, name)[at]) for column, (name, at) in ELEMENTS.items()}
    numbers = (*WHOLE, *NUMBERS)
    return {
        key: value
        for key, value in row.items()
        if value is not None and (key not in numbers or np.isfinite(float(value)))
    }


def _factory_trim(recording: Recording) -> str | None:
    """Return the factory trim of the accelerometer, which identifies a sensor; None if it is not known."""
    words = recording.sensor.accel_offsets
    if words is None or not any(words):
        return None
    return "-".join(f"{word & 0xFFFF:04x}" for word in words)


def _recording_time(recording: Recording) -> str | None:
    """Return the time of day of the first sample, ISO 8601; None if it is not known."""
    if recording.utc_ns is None:
        return None
    began_s = recording.utc_ns * 1e-9 + float(recording.t[0])
    return datetime.fromtimestamp(round(began_s), UTC).isoformat()
