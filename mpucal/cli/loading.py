"""A calibration that a command was given, and what is said of its file."""

from __future__ import annotations

from pathlib import Path

from ..result.calibration import Calibration
from .person import say


def loaded(path: Path) -> Calibration:
    """The calibration in a file; where its numbers may have changed since it was saved, that is said.

    Raises
    ------
    RecordingError : see Calibration.load.
    """
    calibration = Calibration.load(path)
    if calibration.doubt:
        say(f"{path}: {calibration.doubt}.")
    return calibration
