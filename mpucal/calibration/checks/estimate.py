"""Checks of the estimate: directions that are not observable, no convergence, contradictions, a change midway."""

from __future__ import annotations

import numpy as np

from ...reasons import Reason, reason
from ..evidence import Agreement, Evidence
from ..tilt import CONE_RAD

GOOD_RMS_MPS2, USABLE_RMS_MPS2 = 0.1, 0.4
CONSISTENT_NIS = 5.0
RESTS_MPS2, RESTS_RAD = 0.08, np.deg2rad(1.5)
HONEST_FACTOR = 5.0
REFUSED_FACTOR = 5.0
# Of a change's significance. Hands whose pivot wobbles reach 4.5 without one. A gyroscope's non-linearity, which pauses
# show most, makes it 10 with a real sensor.
STEADY, STEADY_BY_RESTS = 5.0, 12.0
UNSTEADY_BY_FAR = 4.0
# So well agree no pauses of a sensor that changed.
AGREE_MPS2, AGREE_RAD = 0.015, np.deg2rad(0.1)


def few_orientations(e: Evidence) -> Reason | None:
    """A direction that the data leave open."""
    if e.fit is None or (e.sure is not None and e.sure.rms_mps2 <= GOOD_RMS_MPS2):
        return None
    if e.sure is None:
        return reason("few_orientations", "nothing_known")
    worst, rms = e.sure.worst, e.sure.rms_mps2
    side = " ".join(f"{'+' if w > 0 else '-'}{axis}" for axis, w in zip("xyz", worst, strict=True) if abs(w) > 0.4)
    if rms < e.gravity:
        return reason("few_orientations", "uncertain", rms > USABLE_RMS_MPS2, rms=rms, side=side)
    return reason("few_orientations", "not_observable", side=side)


def tilted_only(e: Evidence) -> Reason | None:
    """Parameters of which tilts say nothing."""
    if e.model != "tilt" or e.fit is None:
        return None
    left = [name for name in e.fit.at_prior if name.startswith(("D_", "b_a_"))]
    named = f"; {', '.join(left)} keep their assumed values, as they are not observable" if left else ""
    return reason("few_orientations", "tilted", degrees=np.rad2deg(CONE_RAD), left=named)


def not_converged(e: Evidence) -> Reason | None:
    """A minimiser that did not settle."""
    if e.fit is None or e.fit.converged:
        return None
    return reason("not_converged", "iterations", iterations=e.fit.iterations)


def inconsistent(e: Evidence) -> Reason | None:
    """Data that the model does not explain: innovations beyond white noise, pauses that contradict the estimate."""
    if e.fit is None or e.sure is None:
        return None
    # a robust model leaves outliers in its innovations: only the others are judged by them
    if e.model != "hand" and e.fit.nis > CONSISTENT_NIS:
        after = float(np.median(np.linalg.norm(e.calibrated, axis=1))) if e.calibrated is not None else np.nan
        return reason("inconsistent", "innovations", not abs(after / e.gravity - 1.0) < 0.05, nis=e.fit.nis)
    if e.agreement is None:
        return None
    magnitude, miss = e.agreement.magnitude_rms, e.agreement.miss_median
    too_long = magnitude > max(RESTS_MPS2, HONEST_FACTOR * e.sure.magnitude_mps2)
    too_far = miss > max(RESTS_RAD, HONEST_FACTOR * e.sure.direction_rad)
    if not (too_long or too_far):
        return None
    by_far = magnitude > REFUSED_FACTOR * RESTS_MPS2 or miss > REFUSED_FACTOR * RESTS_RAD
    return reason("inconsistent", "pauses", by_far, magnitude=magnitude, degrees=np.rad2deg(miss))


def changed_midway(e: Evidence) -> Reason | None:
    """A mount that slipped or a bias that stepped, where nothing else speaks against the estimate.

    Lost and clipped samples pull at an estimate too, and have reasons of their own.
    """
    if e.model == "tilt" or e.fit is None or not e.fit.converged or inconsistent(e) is not None:
        return None
    if few_orientations(e) is not None:
        return None
    r = e.recording
    if r.gyr_clipped.any() or r.acc_clipped.any() or r.gap.any() or e.change is None:
        return None
    if e.change.rests_often and _agree(e.agreement):
        return None
    limit = STEADY_BY_RESTS if e.change.rests_often else STEADY
    if e.change.significance <= limit:
        return None
    by_far = e.change.significance > UNSTEADY_BY_FAR * limit
    return reason("inconsistent", "change", by_far, seconds=e.change.t_s - r.t[0])


def _agree(found: Agreement | None) -> bool:
    return found is not None and found.magnitude_rms < AGREE_MPS2 and found.miss_median < AGREE_RAD
