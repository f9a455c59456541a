"""Update of a calibration's biases: b_a and b_omega from the calibration and a check together; D and K stay."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..data import Recording
from ..errors import RefusedError
from ..result.calibration import Calibration
from ..result.correction import make_correction
from ..result.correlation import NAMES, correlation_of, standard_deviations
from .drift import to_theta
from .observed import BETA, CALIBRATED, DELTA, apply_errors
from .outcome import CheckResult

HISTORY = "updated_from"


def update_biases(calibration: Calibration, result: CheckResult, recording: Recording, created: str) -> Calibration:
    """Return the calibration with the biases that a check estimated.

    Parameters
    ----------
    result : of a check of it by `recording`. created : the time of the check, ISO 8601.

    Returns
    -------
    Calibration : `extra["updated_from"]` holds the biases of each earlier one, the oldest first. Unless b_a(T) is
        known, its temperature is that of the check.

    Raises
    ------
    RefusedError : more than the biases has changed, or the check could not tell.
    """
    if result.theta is None or result.covariance is None or not result.only_biases:
        raise RefusedError(f"no calibration was updated: {result.message}", result.remedy)
    ready = make_correction(calibration, recording.sensor, recording.autopilot).calibration
    after = apply_errors(ready, result.theta)
    T_0, change_c = ready.sensor.temperature_c, result.temperature_change_c
    T = T_0 if T_0 is None or change_c is None or ready.follows_temperature else T_0 + change_c
    errors = np.linalg.inv(to_theta(ready))
    covariance = (errors @ result.covariance @ errors.T)[:CALIBRATED, :CALIBRATED]
    new = replace(
        ready,
        b_a=after.b_a,
        b_omega=np.where(np.isfinite(after.b_omega), after.b_omega, result.theta[DELTA]),
        b_a_std=np.sqrt(np.diag(covariance)[BETA]),
        b_omega_std=np.sqrt(np.diag(covariance)[DELTA]),
        created=created,
        sensor=replace(ready.sensor, temperature_c=T),
        extra={**ready.extra, HISTORY: [*ready.extra.get(HISTORY, ()), _earlier_biases(calibration, result)]},
    )
    return replace(new, correlation=correlation_of(NAMES, covariance, standard_deviations(vars(new))))


def _earlier_biases(calibration: Calibration, result: CheckResult) -> dict[str, Any]:
    return {
        "created": calibration.created,
        "temperature_c": calibration.sensor.temperature_c,
        "b_a": calibration.b_a,
        "b_a_std": calibration.b_a_std,
        "b_omega": calibration.b_omega,
        "found": result.verdict,
        "what": result.what,
    }
