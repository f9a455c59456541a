"""What calibration.json says of an autopilot: old parameters, new ones, and what they leave."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2, Autopilot
from ...result.calibration import Calibration
from .compose import compose
from .names import find_slot, mounting

OLD, NEW, RESIDUAL = "params_old", "params_new", "residual_mps2"
RESIDUAL_OLD, UNCERTAIN = "residual_old_mps2", "uncertainty_mps2"


def autopilot_document(autopilot: Autopilot, calibration: Calibration) -> dict[str, Any]:
    """The document's `autopilot` of one IMU.

    Its keys: firmware, imu (from 1), message (the stream it was fitted to), params_old and params_new by name,
    residual_mps2 (by how much |a| stays wrong at worst), residual_old_mps2 (the same with the old parameters),
    uncertainty_mps2 (standard uncertainty of |a| by the calibration), turn_deg (the rotation that parameters do not
    hold), and mounting (R_b by row). Where the vehicle did not tell what is needed, params_new is empty, and `why`
    says what.
    """
    document: dict[str, Any] = {
        "firmware": autopilot.firmware,
        "imu": autopilot.imu,
        "message": autopilot.message,
        OLD: dict(autopilot.parameters),
        NEW: {},
        RESIDUAL: None,
    }
    where = find_slot(autopilot.firmware, autopilot.imu, autopilot.parameters)
    if where is None:
        return document | {"why": f"no slot of the vehicle's names the sensor of IMU {autopilot.imu}"}
    old, R_b = where.correction(autopilot.parameters), mounting(autopilot.firmware, where, autopilot.parameters)
    if old is None or R_b is None:
        missing = "values of " + where.names[0] + " and the like" if old is None else "board rotation"
        return document | {"why": f"the recording does not hold the vehicle's {missing}"}
    if not np.all(old.scale):
        return document | {"why": f"{where.scale[0]} and the like are 0: IMU {autopilot.imu} streams nothing yet"}
    known = np.isfinite(calibration.D).all() and np.isfinite(calibration.b_a).all()
    if not known or np.linalg.matrix_rank(calibration.D) < 3:
        return document | {"why": "the calibration was refused"}
    gravity = float(calibration.fit.get("gravity") or STANDARD_GRAVITY_MPS2)
    composed = compose(calibration.D, calibration.b_a, where.effective(old), R_b, gravity)
    new = where.effective(composed.correction)
    return document | {
        NEW: where.values(new),
        RESIDUAL: composed.residual_of(new),
        RESIDUAL_OLD: composed.residual_of(where.effective(old)),
        UNCERTAIN: calibration.magnitude_std,
        "turn_deg": np.degrees(composed.turn_rad).tolist(),
        "mounting": R_b.tolist(),
    }
