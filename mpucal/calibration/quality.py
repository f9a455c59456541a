"""The verdict on an estimate: good, usable or refused, with its reasons. Knows no estimator."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ..data import Vector
from ..result.calibration import GOOD, REFUSED, USABLE
from .blockers import BLOCKERS, no_gyroscope
from .evidence import Evidence
from .reasons import CHECKS


def judge(evidence: Evidence) -> Mapping[str, Any]:
    """The `quality` of calibration.json: verdict, reasons, the magnitude before and after, and how sure.

    `error_std` is what a calibrated measurement's error amounts to over all directions: rms and magnitude [m/s^2],
    direction [deg].
    """
    sure = evidence.sure
    # a fit there is only where nothing blocked it
    checks = CHECKS if evidence.fit is not None else (*BLOCKERS, *CHECKS)
    if no_gyroscope(evidence) is not None:
        checks = (no_gyroscope,)
    found = [reason for check in checks if (reason := check(evidence)) is not None]
    # what refuses it comes before mere reservations
    reasons = sorted(found, key=lambda reason: not reason.refuse)
    return MappingProxyType(
        {
            "verdict": REFUSED if any(r.refuse for r in reasons) else USABLE if reasons else GOOD,
            "reasons": [{"code": r.code, "message": r.message} for r in reasons],
            "magnitude_before": _magnitude(evidence.recording.acc),
            "magnitude_after": _magnitude(evidence.calibrated),
            "error_std": {
                "rms": np.nan if sure is None else sure.rms_mps2,
                "magnitude": np.nan if sure is None else sure.magnitude_mps2,
                "direction_deg": np.nan if sure is None else np.rad2deg(sure.direction_rad),
            },
        }
    )


def _magnitude(acc: Vector | None) -> dict[str, float]:
    if acc is None:
        return {"median": np.nan, "mean": np.nan, "std": np.nan}
    a = np.linalg.norm(acc, axis=1)
    return {"median": float(np.median(a)), "mean": float(a.mean()), "std": float(a.std())}
