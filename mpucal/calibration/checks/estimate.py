"""Checks of the estimate: directions that are not observable, no convergence, contradictions, a change midway."""

from __future__ import annotations

import numpy as np

from ...data import STANDARD_GRAVITY_MPS2
from ...reasons import Reason, reason
from ..bias_walks import BiasWalk
from ..claim import MOST_NIS
from ..evidence import Evidence
from ..tilt import CONE_RAD

# of a claim, 1 sigma: errors of 0.1 m/s^2 are then rare
GOOD_RMS_MPS2, USABLE_RMS_MPS2 = 0.055, 0.4
CHANCE = 1.5  # times the model's claim: so much parts differ by chance
RESTS_MPS2, RESTS_RAD = 0.08, np.deg2rad(1.5)
# below which a hand turns by too much from sample to sample
ENOUGH_HZ = 20.0
HONEST_FACTOR = 5.0
REFUSED_FACTOR = 5.0
# by which readings are off because of a change of the bias or the mount: less is no news, and more is refused
LEAST_CHANGE_MPS2, CHANGED_MPS2 = {"accelerometer": 0.004, "mount": 0.02}, 0.2
# times the model's claim, and m/s^2, that leaving a part out says
DISAGREE, DISAGREE_MPS2 = 4.0, 0.02


def few_orientations(e: Evidence) -> Reason | None:
    """A direction that the data leave open, where the model holds."""
    rms = _model_rms(e)
    if e.fit is None or (rms is not None and rms <= GOOD_RMS_MPS2):
        return None
    if e.sure is None or rms is None:
        return reason("few_orientations", "nothing_known")
    side = " ".join(
        f"{'+' if w > 0 else '-'}{axis}" for axis, w in zip("xyz", e.sure.worst, strict=True) if abs(w) > 0.4
    )
    known = max(rms, e.sure.rms_mps2) if _useless(e) else rms
    if known < e.gravity:
        return reason("few_orientations", "uncertain", _useless(e), rms=known, side=side)
    return reason("few_orientations", "not_observable", side=side)


def _model_rms(e: Evidence) -> float | None:
    """m/s^2 that more orientations make less; None where nothing is known."""
    if e.sure is None:
        return None
    if e.claim is None or e.claim.inflation < CHANCE or (e.claim.by == "side" and not _sides_contradict(e)):
        return e.sure.rms_mps2
    return e.claim.floored


def _sides_contradict(e: Evidence) -> bool:
    """Whether the orientations disagree so much that more of them would not help."""
    return e.claim is not None and e.claim.by == "side" and e.claim.inflation > DISAGREE and _useless(e)


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
    if e.model != "hand" and e.fit.nis > MOST_NIS:
        after = float(np.median(np.linalg.norm(e.calibrated, axis=1))) if e.calibrated is not None else np.nan
        return reason(
            "inconsistent", "innovations", _useless(e) or not abs(after / e.gravity - 1.0) < 0.05, nis=e.fit.nis
        )
    # where every sample is explained, so are the pauses
    if e.model in ("accel", "imu") or e.agreement is None:
        return None
    magnitude, miss = e.agreement.magnitude_rms, e.agreement.miss_median
    too_long = magnitude > max(RESTS_MPS2, HONEST_FACTOR * e.sure.magnitude_mps2)
    too_far = miss > max(RESTS_RAD, HONEST_FACTOR * e.sure.direction_rad)
    if not (too_long or too_far):
        return None
    by_far = magnitude > REFUSED_FACTOR * RESTS_MPS2 or miss > REFUSED_FACTOR * RESTS_RAD
    return reason("inconsistent", "pauses", by_far, magnitude=magnitude, degrees=np.rad2deg(miss))


def changed_midway(e: Evidence) -> Reason | None:
    """A mount that slipped, where nothing else speaks against the estimate."""
    change = _change_of(e, "mount")
    if change is None:
        return None
    begin, end = _since_the_start(e, change.steepest)
    return reason("inconsistent", "change", change.error(e.gravity) > CHANGED_MPS2, begin=begin, end=end)


def zero_moved(e: Evidence) -> Reason | None:
    """An accelerometer whose bias stepped or drifted while the board was turned."""
    change = _change_of(e, "accelerometer")
    if change is None:
        return None
    begin, end = _since_the_start(e, change.steepest)
    size = 1e3 * change.size / STANDARD_GRAVITY_MPS2
    return reason("zero_moved", "walk", _useless(e), size=size, begin=begin, end=end)


def _change_of(e: Evidence, what: str) -> BiasWalk | None:
    """That change, where it is more than is no news.

    Lost and clipped samples pull at an estimate too, and have reasons of their own.
    """
    if e.claim is None or e.claim.change is None or e.claim.change.what != what or _excused(e):
        return None
    known = e.claim.floored <= USABLE_RMS_MPS2
    return e.claim.change if known and e.claim.of_change > LEAST_CHANGE_MPS2[what] else None


def parts_disagree(e: Evidence) -> Reason | None:
    """Times or sides of the recording that say something else than the others, by more than the model's noise."""
    claim = e.claim
    if (
        claim is None
        or e.sure is None
        or inconsistent(e) is not None
        or any(_change_of(e, what) for what in LEAST_CHANGE_MPS2)
    ):
        return None
    if _excused(e) and not _useless(e):
        return None
    too_large = claim.inflation >= CHANCE and e.sure.rms_mps2 > GOOD_RMS_MPS2 >= claim.floored
    much = claim.inflation > DISAGREE and claim.left_out.claim() > DISAGREE_MPS2
    if _sides_contradict(e):
        if e.recording.rate_hz < ENOUGH_HZ:
            return reason("inconsistent", "slow", rms=e.sure.rms_mps2, rate=e.recording.rate_hz)
        return reason("inconsistent", "sides", rms=e.sure.rms_mps2)
    if claim.by == "side":
        return None  # more orientations help, which few_orientations says
    if not too_large and not (much and claim.by == "time"):
        return None
    begin, end = _since_the_start(e, claim.left_out.worst)
    return reason("inconsistent", "part", _useless(e), begin=begin, end=end, rms=e.sure.rms_mps2)


def _useless(e: Evidence) -> bool:
    return e.sure is None or e.sure.rms_mps2 > USABLE_RMS_MPS2


def _excused(e: Evidence) -> bool:
    """Whether something else explains that the parts disagree."""
    if e.fit is None or not e.fit.converged or inconsistent(e) is not None:
        return True
    r = e.recording
    return bool(r.gyr_clipped.any() or r.acc_clipped.any() or r.gap.any())


def _since_the_start(e: Evidence, span: tuple[float, float]) -> tuple[float, float]:
    """s since the recording's start, of times after the flat segment."""
    begin = 0.0 if e.flat is None else float(e.recording.t[e.flat.last - 1] - e.recording.t[0])
    return begin + span[0], begin + span[1]
