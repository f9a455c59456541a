"""How near what a vehicle holds, and what was found of its IMUs, comes to the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mpucal.mavlink.parameters.compose import Correction
from mpucal.mavlink.parameters.names import Place
from mpucal.result.calibration import Calibration
from mpucal.simulated.sensor import SensorTruth

from .judge import judged

# of a row of tables here: at worst over axes and IMUs, offset [m/s^2] and scale
Off = tuple[float, float]


def needed(truth: SensorTruth) -> Correction:
    """The parameters that a sensor needs."""
    return Correction(truth.b_a, np.diag(np.linalg.inv(truth.D)))


def off(where: Place | None, parameters: Mapping[str, float], true: Correction) -> Off:
    """How far an IMU's parameters are from what it needs; infinitely, where there are none."""
    held = None if where is None else where.correction(parameters)
    if held is None:
        return np.inf, np.inf
    return float(np.abs(held.offset - true.offset).max()), float(np.abs(held.scale - true.scale).max())


def z_of(document: Mapping[str, Any], truth: Mapping[str, Any]) -> tuple[float, ...]:
    """(12,) of D and b_a of an IMU's document: (estimate - truth) / standard uncertainty."""
    return judged(Calibration.from_document(document), (np.array(truth["D"]), np.array(truth["b_a"]))).z
