"""The verdict on an estimate: good, usable or refused, with its reasons."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..data import Vector
from ..reasons import Reason
from ..result.calibration import GOOD, REFUSED, USABLE
from .checks import found
from .claim import Claim
from .evidence import Evidence
from .jackknife import OF_SIDE, OF_TIME


def judge(evidence: Evidence) -> Mapping[str, Any]:
    """The `quality` of calibration.json: verdict, reasons, the magnitude before and after, and how sure.

    `error_std` is what a calibrated measurement's error amounts to over all directions: rms and magnitude [m/s^2],
    direction [deg]; and what it rests on, see claim.py.
    """
    sure = evidence.sure
    reasons = found(evidence)
    return {
        "verdict": verdict(reasons),
        "reasons": [reason.document() for reason in reasons],
        "magnitude_before": _magnitude(evidence.recording.acc),
        "magnitude_after": _magnitude(evidence.calibrated),
        "error_std": {
            "rms": np.nan if sure is None else sure.rms_mps2,
            "magnitude": np.nan if sure is None else sure.magnitude_mps2,
            "direction_deg": np.nan if sure is None else np.rad2deg(sure.direction_rad),
            **_decided(evidence.claim),
        },
    }


def _decided(claim: Claim | None) -> dict[str, Any]:
    """By the model, and by leaving times and sides out [m/s^2, rms]; which of them decided."""
    if claim is None:
        return {"model": np.nan, "without_a_time": np.nan, "without_a_side": np.nan, "decided_by": None}
    left_out = claim.left_out
    return {
        "model": claim.model,
        "without_a_time": OF_TIME * left_out.time,
        "without_a_side": OF_SIDE * left_out.side,
        "decided_by": claim.by,
    }


def verdict(reasons: list[Reason]) -> str:
    """What they amount to."""
    return REFUSED if any(reason.refuse for reason in reasons) else USABLE if reasons else GOOD


def _magnitude(acc: Vector | None) -> dict[str, float]:
    if acc is None:
        return {"median": np.nan, "mean": np.nan, "std": np.nan}
    a = np.linalg.norm(acc, axis=1)
    return {"median": float(np.median(a)), "mean": float(a.mean()), "std": float(a.std())}
