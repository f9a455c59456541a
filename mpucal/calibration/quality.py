"""Quality of an estimate: the verdict good, usable or refused, its reasons, and the uncertainty."""

from __future__ import annotations

import numpy as np

from ..data import Vector
from ..reasons import Reason
from ..result.calibration import GOOD, REFUSED, USABLE
from ..result.keys import ErrorStd, Magnitude, Quality, Verdict
from .checks import find_reasons
from .evidence import Evidence
from .rotation import lengths


def judge(evidence: Evidence) -> Quality:
    """Return the `quality` of calibration.json: verdict, reasons, the magnitude before and after, and `error_std`.

    `error_std` is the error of a calibrated measurement over all directions, rms and magnitude [m/s^2] and direction
    [deg], with its parts: the model's own, and what a change, or effects of time or side, may add (hypotheses.py).
    """
    reasons = [reason.about(evidence.recording.sensor.origin) for reason in find_reasons(evidence)]
    return {
        "verdict": verdict(reasons),
        "reasons": [reason.document() for reason in reasons],
        "magnitude_before": _magnitude(evidence.magnitude),
        "magnitude_after": _magnitude(None if evidence.calibrated is None else lengths(evidence.calibrated)),
        "error_std": _error_std(evidence),
    }


def _error_std(evidence: Evidence) -> ErrorStd:
    known, claim = evidence.uncertainty, evidence.claim
    return {
        "rms": np.nan if known is None else known.rms_mps2,
        "magnitude": np.nan if known is None else known.magnitude_mps2,
        "direction_deg": np.nan if known is None else float(np.rad2deg(known.direction_rad)),
        "model": np.nan if claim is None else claim.floored,
        "time": np.nan if claim is None else claim.error("time"),
        "side": np.nan if claim is None else claim.error("side"),
        "change": np.nan if claim is None else claim.error("change"),
        "decided_by": None if claim is None else claim.decided_by,
    }


def verdict(reasons: list[Reason]) -> Verdict:
    """Combine the reasons into one verdict."""
    return REFUSED if any(reason.refuse for reason in reasons) else USABLE if reasons else GOOD


def _magnitude(a: Vector | None) -> Magnitude:
    if a is None:
        return {"median": np.nan, "mean": np.nan, "std": np.nan}
    return {"median": float(np.median(a)), "mean": float(a.mean()), "std": float(a.std())}
