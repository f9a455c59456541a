"""Calibrate all IMUs of a vehicle from one rotation, each as any recording is, and add what its parameters become."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..calibration import calibrate
from ..data import STANDARD_GRAVITY_MPS2, Recording
from ..result.calibration import Calibration

OTHERS, AUTOPILOT = "others", "autopilot"


def calibrate_vehicle(
    recording: Recording, model: str = "auto", gravity: float = STANDARD_GRAVITY_MPS2, gravity_anyway: bool = False
) -> Calibration:
    """As `calibrate`; of a vehicle, also its other IMUs and each one's parameters, in `extra`.

    Raises
    ------
    UsageError : see calibrate.
    """
    calibration = _one(recording, model, gravity, gravity_anyway)
    if not recording.others:
        return calibration
    others = [_one(other, model, gravity, gravity_anyway).document() for other in recording.others]
    return replace(calibration, extra={**calibration.extra, OTHERS: others})


def _one(recording: Recording, model: str, gravity: float, gravity_anyway: bool) -> Calibration:
    calibration = calibrate(recording, model, gravity, gravity_anyway)
    if recording.autopilot is None:
        return calibration
    # most recordings are of no vehicle
    from .parameters.document import autopilot_document  # noqa: PLC0415

    extra: Mapping[str, Any] = {AUTOPILOT: autopilot_document(recording.autopilot, calibration)}
    return replace(calibration, extra={**calibration.extra, **extra})
