"""Calibration of all IMUs of a vehicle from one rotation, each with its autopilot's new parameters."""

from __future__ import annotations

from dataclasses import replace

from ..calibration import calibrate_all
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
    recordings = (recording, *recording.others)
    first, *others = map(_with_parameters, calibrate_all(recording, model, gravity, gravity_anyway), recordings)
    if not others:
        return first
    return replace(first, extra={**first.extra, OTHERS: [other.document() for other in others]})


def _with_parameters(calibration: Calibration, recording: Recording) -> Calibration:
    if recording.autopilot is None:
        return calibration
    extra = {**calibration.extra, AUTOPILOT: autopilot_document(recording.autopilot, calibration)}
    return replace(calibration, extra=extra)
