"""Calibration of all IMUs of a vehicle, and the entries `autopilot` and `others` of its calibration.json."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...calibration import calibrate_all
from ...data import STANDARD_GRAVITY_MPS2, Autopilot, Recording
from ...result.calibration import Calibration

AUTOPILOT, OTHERS = "autopilot", "others"
OLD, NEW, RESIDUAL, FIRST = "params_old", "params_new", "residual_mps2", "params_first"
RESIDUAL_OLD, UNCERTAIN, RESIDUAL_DEG = "residual_old_mps2", "uncertainty_mps2", "residual_deg"


def autopilot_document(autopilot: Autopilot, calibration: Calibration) -> dict[str, Any]:
    """Return the entry `autopilot` of one IMU.

    Its keys: firmware, imu (from 1), message (the stream it was fitted to), params_old and params_new by name,
    params_first (those of params_old that were changed meanwhile, as they were at first), residual_mps2 (greatest error
    of |a| that is left), residual_old_mps2 (the same with the old parameters), residual_deg (greatest error of the
    direction that is left, beside turn_deg),
    uncertainty_mps2 (standard uncertainty of |a| by the calibration), turn_deg (the rotation that parameters do not
    hold), and mounting (R_b by row). If the vehicle did not tell what is needed, params_new is empty, and `why` says
    what is missing.
    """
    from .mounting import mounting  # noqa: PLC0415 - only a vehicle's session needs them
    from .slots import compose, find_slot  # noqa: PLC0415

    document: dict[str, Any] = {
        "firmware": autopilot.firmware,
        "imu": autopilot.imu,
        "message": autopilot.message,
        OLD: dict(autopilot.parameters),
        NEW: {},
        RESIDUAL: None,
    }
    if autopilot.first:
        document[FIRST] = dict(autopilot.first)
    slot = find_slot(autopilot.firmware, autopilot.imu, autopilot.parameters)
    if slot is None:
        return document | {"why": f"no slot of the vehicle names the sensor of IMU {autopilot.imu}"}
    old, R_b = slot.correction(autopilot.parameters), mounting(autopilot.firmware, slot, autopilot.parameters)
    if old is None or R_b is None:
        missing = "values of " + slot.names[0] + " and the like" if old is None else "board rotation"
        return document | {"why": f"the recording does not hold the vehicle's {missing}"}
    if not np.all(old.scale):
        return document | {"why": f"{slot.scale[0]} and the like are 0: IMU {autopilot.imu} streams nothing yet"}
    if not calibration.is_regular:
        return document | {"why": "the calibration was refused"}
    old = slot.effective(old)
    composed = compose(calibration.D, calibration.b_a, old, R_b, calibration.gravity)
    new = slot.effective(composed.correction)
    return document | {
        NEW: slot.values(new),
        RESIDUAL: composed.residual_of(new),
        RESIDUAL_OLD: composed.residual_of(old),
        RESIDUAL_DEG: float(np.degrees(composed.residual_rad_of(new))),
        UNCERTAIN: calibration.magnitude_std,
        "turn_deg": np.degrees(composed.turn_rad).tolist(),
        "mounting": R_b.tolist(),
    }


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
