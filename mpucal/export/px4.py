"""A calibration as PX4's parameters in a .params file, which QGroundControl loads."""

from __future__ import annotations

from ..mavlink.firmwares import PX4
from ..mavlink.parameters.text import params_text
from ..result.calibration import Calibration
from .parameters import notes, remarks, values

ENDING = ".params"
UNNOTICED = "PX4 takes a vector over at once only where it differs by more than 0.01 from the one in use; restart it."


def export(calibration: Calibration) -> tuple[str, tuple[str, ...]]:
    """The file's text, and what it cannot hold, a sentence each.

    Raises
    ------
    WriteBackError : a calibration that is refused, of no vehicle or of another firmware, or beyond PX4's limits.
    """
    held = values(calibration, PX4)
    return params_text(held, remarks(calibration, PX4)), (*notes(calibration, PX4), UNNOTICED)
