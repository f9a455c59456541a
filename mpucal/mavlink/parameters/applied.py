"""A calibration of a vehicle's streams as they are once its new parameters are in place."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ...result.calibration import Calibration
from .document import NEW, OLD, RESIDUAL, RESIDUAL_OLD
from .names import slot_of


def applied(calibration: Calibration, imus: Collection[int]) -> Calibration:
    """Of the streams that come now: y' = A y + c of the y that was calibrated, so D' = A D and b_a' = A b_a + c.

    Parameters
    ----------
    imus : those, counted from 1, whose new parameters are in place.
    """
    extra = dict(calibration.extra)
    if "others" in extra:
        extra["others"] = [_one(Calibration.from_document(o), imus).document() for o in extra["others"]]
    return _one(replace(calibration, extra=extra), imus)


def of_imu(calibration: Calibration, imu: int) -> Calibration:
    """The calibration of one IMU, counted from 1.

    Raises
    ------
    KeyError : it holds none.
    """
    if calibration.extra.get("autopilot", {}).get("imu") == imu:
        return calibration
    for other in calibration.extra.get("others", []):
        if other.get("autopilot", {}).get("imu") == imu:
            return Calibration.from_document(other)
    raise KeyError(imu)


def _one(calibration: Calibration, imus: Collection[int]) -> Calibration:
    autopilot = calibration.extra.get("autopilot", {})
    if autopilot.get("imu") not in imus:
        return calibration
    where = slot_of(autopilot["firmware"], autopilot["imu"], autopilot[NEW])
    old = None if where is None else where.correction(autopilot[OLD])
    new = None if where is None else where.correction(autopilot[NEW])
    if where is None or old is None or new is None:
        return calibration
    R_b, old = np.array(autopilot["mounting"]), where.effective(old)
    A = R_b @ np.diag(new.scale / old.scale) @ R_b.T
    c = R_b @ (new.scale * (old.offset - new.offset))
    now = {**autopilot, OLD: {**autopilot[OLD], **autopilot[NEW]}, RESIDUAL_OLD: autopilot[RESIDUAL]}
    extra = {**calibration.extra, "autopilot": now}
    return replace(calibration, D=A @ calibration.D, b_a=A @ calibration.b_a + c, extra=extra)
