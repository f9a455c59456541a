"""Loading of a calibration that a command was given, with a warning if its file was changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..data import STANDARD_GRAVITY_MPS2
from ..errors import WriteBackError
from ..result.calibration import Calibration
from .person import say

force_option = click.option("--force", is_flag=True, help="Accept a calibration whose digest is missing or wrong.")


def load_calibration(path: Path) -> Calibration:
    """Load a calibration; warn if its numbers may have changed since it was saved.

    Raises
    ------
    RecordingError : see Calibration.load.
    """
    calibration = Calibration.load(path)
    if calibration.doubt:
        say(f"{path}: {calibration.doubt}.")
    return calibration


def load_trusted(path: Path, force: bool) -> Calibration:
    """Load a calibration that is to be written somewhere.

    Raises
    ------
    WriteBackError : its digest or CRC does not match, and `force` is not given.
    RecordingError : see Calibration.load.
    """
    calibration = load_calibration(path)
    if calibration.doubt and not force:
        raise WriteBackError(f"nothing was written: {path}: {calibration.doubt}", "look at it, then give --force")
    return replace(calibration, doubt="")


def at_gravity_of(calibration: Calibration | None, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return a source's options with the gravity of a calibration: a simulated chip is examined where it was made."""
    return {**options, "gravity": STANDARD_GRAVITY_MPS2 if calibration is None else calibration.gravity}
