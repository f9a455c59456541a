"""Checks of the estimate: directions that are not observable, no convergence, contradictions, a change midway."""

from __future__ import annotations

import numpy as np
from numpy.linalg import norm

from ...data import STANDARD_GRAVITY_MPS2
from ...origin import Origin
from ...reasons import Reason, reason
from ..evidence import Evidence
from ..slip import Slip
from ..tilt import CONE_RAD
from ..transitions import MOST_MISS_RAD
from ..uncertainty import MOST_NIS
from .recording import SEPARABLE_HZ

# Claimed uncertainty, 1 sigma, of a good and of a usable calibration: errors above 0.1 m/s^2 are then rare.
GOOD_RMS_MPS2, USABLE_RMS_MPS2 = 0.055, 0.4
# How far |a| strays, in units of its change of course within 10 ms, and this change divided by that of the rates [m/s^2
# for each rad/s]. In hands the first is at most 30, or the second at least 0.6; on machines the second is 10 to
# 30; in the gravity of a fusion filter the first is at least 76, and the second at most 0.35.
SMOOTH, LEAST_BENT_MPS = 66.0, 0.5
# Errors of readings by a change of the sensor: smaller ones are not reported, larger ones of its matrix refused.
LEAST_CHANGE_MPS2, CHANGED_MPS2 = 0.004, 0.2


def few_orientations(e: Evidence) -> Reason | None:
    """Find directions that the data leave open.

    More orientations do not help where the readings are coarse, or where a hand held it in many: then it moved as it
    rested, with the hand or with the ground.
    """
    rms = _model_rms(e)
    if rms is not None and rms <= GOOD_RMS_MPS2:
        return None
    if e.uncertainty is None or rms is None:
        return reason("few_orientations", "nothing_known")
    side = " ".join(
        f"{'+' if w > 0 else '-'}{axis}" for axis, w in zip("xyz", e.uncertainty.worst, strict=True) if abs(w) > 0.4
    )
    known = max(rms, e.uncertainty.rms_mps2) if _is_useless(e) else rms
    if known >= e.gravity:
        return reason("few_orientations", "not_observable", side=side)
    if contradiction(e) is None:
        if (coarse := _coarse(e, known)) is not None:
            return coarse
        if e.model == "hand" and e.was_held_all_around:
            return reason("inconsistent", "moved", _is_useless(e), rms=known)
    return reason("few_orientations", "uncertain", _is_useless(e), rms=known, side=side)


def _model_rms(e: Evidence) -> float | None:
    """Return the uncertainty [m/s^2] that more orientations would reduce; None where D is unusable."""
    if e.uncertainty is None:
        return None
    return e.uncertainty.rms_mps2 if e.claim is None or e.claim.worst is None else e.claim.floored


def tilted_only(e: Evidence) -> Reason | None:
    """Find a board that was only tilted, and name the parameters that keep their assumed values."""
    if e.model != "tilt":
        return None
    left = [name for name in e.estimate.at_prior if name.startswith(("D_", "b_a_"))]
    named = f"; {', '.join(left)} keep their assumed values, as they are not observable" if left else ""
    return reason("few_orientations", "tilted", degrees=np.rad2deg(CONE_RAD), left=named)


def not_converged(e: Evidence) -> Reason | None:
    """Find a minimiser that did not settle."""
    fit = e.estimate
    return None if fit.converged else reason("not_converged", "iterations", iterations=fit.iterations)


def smoothed(e: Evidence) -> Reason | None:
    """Find accelerations that were computed or smoothed: only what a hand does below 3 Hz is left of its motion."""
    away, bent, of_rates = e.magnitude_errors
    if not away > SMOOTH * bent or bent > LEAST_BENT_MPS * of_rates or e.recording.sensor.origin is Origin.VEHICLE:
        return None
    return reason("not_raw", "smoothed", away=away, bent=bent)


def inconsistent(e: Evidence) -> Reason | None:
    """Find data that the model does not explain: axes exchanged midway, rests that differ, innovations beyond noise."""
    fit = e.estimate
    if e.uncertainty is None:
        return None
    if (span := exchange(e)) is not None:
        return reason("inconsistent", "change", True, begin=span[0], end=span[1])
    if fit.spread_mps2 > CHANGED_MPS2:
        return reason("inconsistent", "rests", spread=fit.spread_mps2)
    # A robust model leaves outliers in its innovations: its parts judge it, or its uncertainty has grown by them.
    if e.model in ("hand", "tilt") or not fit.nis > MOST_NIS:
        return None
    # The noise is larger than the model's by as much as the innovations are, and so is what is known.
    refuse = e.uncertainty.rms_mps2 * (fit.nis / 3.0) ** 0.5 > USABLE_RMS_MPS2
    return reason("inconsistent", "innovations", refuse, nis=fit.nis)


def contradiction(e: Evidence) -> Reason | None:
    """Find a sensor that changed midway, or times or sides that contradict the others beyond the model's noise."""
    claim, worst = e.claim, None if e.claim is None else e.claim.worst
    if claim is None or e.uncertainty is None or inconsistent(e) is not None:
        return None
    rms, change, disturbed = e.uncertainty.rms_mps2, claim.change, _is_disturbed(e)
    if (slip := likely_slip(e)) is not None:
        begin, end = _since_the_start(e, slip.span)
        return reason("inconsistent", "change", bool(e.gravity * norm(slip.delta) > CHANGED_MPS2), begin=begin, end=end)
    if change is not None and not disturbed and claim.error("change") > LEAST_CHANGE_MPS2:
        begin, end = _since_the_start(e, change.span)
        if change.hypothesis.what != "accelerometer":
            refuse = claim.error("change") > CHANGED_MPS2 or _is_useless(e)
            return reason("inconsistent", "change", refuse, begin=begin, end=end)
        size = 1e3 * change.size / STANDARD_GRAVITY_MPS2
        if change.hypothesis.shape == "step":
            return reason("zero_moved", "step", _is_useless(e), size=size, begin=begin, end=end)
        return reason("zero_moved", "walk", _is_useless(e), size=size, begin=begin, end=end)
    disturbed |= not e.estimate.converged
    if worst is None or (disturbed and not _is_useless(e)) or not rms > GOOD_RMS_MPS2 >= claim.floored:
        return None
    if (coarse := _coarse(e, rms)) is not None:
        return coarse
    if worst.hypothesis.kind == "side":
        if e.recording.rate_hz < SEPARABLE_HZ:
            return reason("inconsistent", "slow", _is_useless(e), rms=rms, rate=e.recording.rate_hz)
        return reason("inconsistent", "sides", _is_useless(e), rms=rms)
    begin, end = _since_the_start(e, worst.span)
    return reason("inconsistent", "part", _is_useless(e), begin=begin, end=end, rms=rms)


def likely_slip(e: Evidence) -> Slip | None:
    """Return the slip of the mount, unless another change surely happened, or a calibration would be good with it.

    Times or sides that differ do not speak against it: where a slip leads the fit astray, they do. A large miss that is
    left between rests does: a gyroscope at fault misses anywhere.
    """
    slip, change = e.estimate.slip, None if e.claim is None else e.claim.change
    if slip is None or not (slip.near_end or change is None or change.hypothesis.what == "mount"):
        return None
    left = max(norm(each.miss) for each in slip.transitions)
    return slip if left < MOST_MISS_RAD and e.gravity * norm(slip.delta) > GOOD_RMS_MPS2 else None


def exchange(e: Evidence) -> tuple[float, float] | None:
    """Return times [s since the recording's start] between which axes were exchanged, or None.

    A calibration that is good leaves no doubt of them.
    """
    is_good = e.uncertainty is not None and e.uncertainty.rms_mps2 <= GOOD_RMS_MPS2
    return None if is_good else e.axes_exchanged_s


def _coarse(e: Evidence, rms: float) -> Reason | None:
    """Return the reason of an estimate with an uncertainty [m/s^2] of less than two steps of the readings, or None."""
    words = None if e.decoded is None else e.decoded.words[0]
    if words is None:
        return None
    step = words.lsb * words.finest
    return reason("inconsistent", "coarse", _is_useless(e), rms=rms, step=step) if rms < 2.0 * step else None


def _is_useless(e: Evidence) -> bool:
    return e.uncertainty is None or e.uncertainty.rms_mps2 > USABLE_RMS_MPS2


def _is_disturbed(e: Evidence) -> bool:
    """Return True if samples are lost or clipped: parts disagree then, too."""
    r = e.recording
    return bool(r.gyr_clipped.any() or r.acc_clipped.any() or r.gap.any())


def _since_the_start(e: Evidence, span: tuple[float, float]) -> tuple[float, float]:
    """Return times after the flat segment as times since the recording's start [s]."""
    begin = float(e.recording.t[e.flat_segment.last - 1] - e.recording.t[0])
    return begin + span[0], begin + span[1]
