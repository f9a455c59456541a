"""Calibration of all IMUs of a vehicle from one rotation, each with its autopilot's new parameters."""

from __future__ import annotations

from dataclasses import replace

from ..calibration import calibrate
from ..data import STANDARD_GRAVITY_MPS2, Recording
from ..result.calibration import Calibration
from .parameters.document import AUTOPILOT, OTHERS, autopilot_document


def calibrate_vehicle(
    recording: Recording, model: str = "auto", gravity: float = STANDARD_GRAVITY_MPS2, gravity_anyway: bool = False
) -> Calibration:
    """Calibrate like `calibrate`, and put a vehicle's other IMUs and each one's parameters into `extra`.

    Raises
    ------
    UsageError : see calibrate.
    """
    calibration = calibrate(recording, model, gravity, gravity_anyway)
    extra = dict(calibration.extra)
    if recording.autopilot is not None:
        extra[AUTOPILOT] = autopilot_document(recording.autopilot, calibration)
    if recording.others:
        others = [calibrate_vehicle(other, model, gravity, gravity_anyway) for other in recording.others]
        extra[OTHERS] = [other.document() for other in others]
    return replace(calibration, extra=extra)
