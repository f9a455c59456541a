"""A calibration as ArduPilot's parameters in a .param file, which Mission Planner and MAVProxy load."""

from __future__ import annotations

from ..mavlink.firmwares import ARDUPILOT
from ..mavlink.parameters.text import param_text
from ..result.calibration import Calibration
from .parameters import notes, remarks, values

ENDING = ".param"


def export(calibration: Calibration) -> tuple[str, tuple[str, ...]]:
    """The file's text, and what it cannot hold, a sentence each.

    Raises
    ------
    WriteBackError : a calibration that is refused, of no vehicle or of another firmware, or beyond ArduPilot's limits.
    """
    held = values(calibration, ARDUPILOT)
    return param_text(held, remarks(calibration, ARDUPILOT)), notes(calibration, ARDUPILOT)
