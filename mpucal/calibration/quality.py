"""The verdict on an estimate: good, usable or refused, with its reasons."""

from __future__ import annotations

import numpy as np

from ..data import Vector
from ..reasons import Reason
from ..result.calibration import GOOD, REFUSED, USABLE
from ..result.keys import ErrorStd, Magnitude, Quality, Verdict
from .checks import find_reasons
from .claim import Claim
from .evidence import Evidence
from .jackknife import OF_SIDE, OF_TIME
from .rotation import lengths
from .uncertainty import Uncertainty


def judge(evidence: Evidence) -> Quality:
    """The `quality` of calibration.json: verdict, reasons, the magnitude before and after, and how sure.

    `error_std` is what a calibrated measurement's error amounts to over all directions: rms and magnitude [m/s^2],
    direction [deg]; and what it rests on, see claim.py.
    """
    reasons = find_reasons(evidence)
    return {
        "verdict": verdict(reasons),
        "reasons": [reason.document() for reason in reasons],
        "magnitude_before": _magnitude(evidence.recording.acc),
        "magnitude_after": _magnitude(evidence.calibrated),
        "error_std": _error_std(evidence.sure, evidence.claim),
    }


def _error_std(sure: Uncertainty | None, claim: Claim | None) -> ErrorStd:
    left_out = None if claim is None else claim.left_out
    return {
        "rms": np.nan if sure is None else sure.rms_mps2,
        "magnitude": np.nan if sure is None else sure.magnitude_mps2,
        "direction_deg": np.nan if sure is None else float(np.rad2deg(sure.direction_rad)),
        "model": np.nan if claim is None else claim.floored,
        "without_a_time": np.nan if left_out is None else OF_TIME * left_out.time,
        "without_a_side": np.nan if left_out is None else OF_SIDE * left_out.side,
        "decided_by": None if claim is None else claim.by,
    }


def verdict(reasons: list[Reason]) -> Verdict:
    """What they amount to."""
    return REFUSED if any(reason.refuse for reason in reasons) else USABLE if reasons else GOOD


def _magnitude(acc: Vector | None) -> Magnitude:
    if acc is None:
        return {"median": np.nan, "mean": np.nan, "std": np.nan}
    a = lengths(acc)
    return {"median": float(np.median(a)), "mean": float(a.mean()), "std": float(a.std())}
