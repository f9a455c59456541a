"""A calibration that a command was given, and what is said of its file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from ..errors import WriteBackError
from ..result.calibration import Calibration
from .person import say

force_option = click.option("--force", is_flag=True, help="Take a calibration whose digest is missing or wrong.")


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


def trusted(path: Path, force: bool) -> Calibration:
    """The calibration in a file, for one to be written whose digest or CRC matches.

    Raises
    ------
    WriteBackError : its numbers may not be those that were saved, and `force` is not given.
    RecordingError : see Calibration.load.
    """
    calibration = loaded(path)
    if calibration.doubt and not force:
        raise WriteBackError(f"nothing was written: of {path}, {calibration.doubt}", "look at it, then give --force")
    return replace(calibration, doubt="")
