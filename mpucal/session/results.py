"""The files that a calibration leaves in a folder. Knows no other place to write to."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Recording
from ..errors import OutputError
from ..report import render
from ..result.atomic import write_together
from ..result.calibration import REFUSED, Calibration

CAPTURE, DOCUMENT, BLOB, REPORT, TRUTH = (
    "capture.mcap",
    "calibration.json",
    "calibration.bin",
    "report.html",
    "truth.json",
)


def result_files(
    calibration: Calibration, recording: Recording, truth: Mapping[str, Any] | None = None
) -> Iterator[tuple[str, bytes]]:
    """Name and content of each file, made one at a time; a refused calibration has no blob.

    truth : what a simulated sensor really is.
    """
    yield DOCUMENT, calibration.json().encode()
    known = np.isfinite(calibration.D).all() and np.isfinite(calibration.b_a).all()
    if calibration.verdict != REFUSED and known:
        yield BLOB, calibration.blob().encode()
    yield REPORT, render(calibration, recording).encode()
    if truth is not None:
        yield TRUTH, (json.dumps(truth, indent=2) + "\n").encode()


def save(folder: Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write files by their names, all or none; calibration.json last, as it says that the others hold.

    Raises
    ------
    OutputError : the folder or one of them cannot be written.
    """
    write_together({folder / name: files[name] for name in sorted(files, key=lambda name: name == DOCUMENT)})
    return tuple(folder / name for name in files)


def make_folder(folder: Path) -> None:
    """Make `folder` where it is missing.

    Raises
    ------
    OutputError : it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"cannot make the folder {folder} ({error.strerror})", "choose another one with -o"
        ) from error
