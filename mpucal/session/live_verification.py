"""Verification of a first calibration by new orientations: agreement, likeliest reason against it, and verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..calibration.checks.estimate import USABLE_RMS_MPS2
from ..calibration.evidence import Evidence
from ..calibration.hypothesis_tests import MOST_STD
from ..calibration.rotation import units
from ..calibration.verification import NewOrientation
from ..data import AXES, Recording, Vector
from ..origin import Origin
from ..reasons import KINDS, Reason, ReasonFound, is_explained, reason
from ..rests.intervals import statistics
from ..result.calibration import REFUSED, USABLE, Calibration
from ..result.keys import Quality
from .events import Checked, Verification, triple
from .rotate import REST_S

# A shorter turn is too little changed by a scale factor error to show one.
LONG_TURN_RAD = np.deg2rad(40.0)
# If the temperature has changed by more since the board lay flat, the first calibration does not hold any more.
MOST_CHANGE_C = 8.0
# The reason that more orientations remove, and the reasons beside which they do not help.
FEW = "few_orientations"
CONTRADICTIONS = KINDS[FEW].explained_by
MUCH_CLIPPED = 0.002
_IN_DOCUMENT = "down", "magnitude_mps2", "magnitude_std_mps2", "direction_deg", "direction_std_deg", "agrees"


def select_unseen(rests: Sequence[NewOrientation], evidence: Evidence, apart_rad: float) -> list[NewOrientation]:
    """Return the rests that are `apart_rad` or more from every rest that the fit has seen, and from each other."""
    known, unseen = _fitted_directions(evidence), []
    for rest in rests:
        if not len(known) or float((known @ rest.down).max()) <= math.cos(apart_rad):
            known = np.vstack([known, rest.down])
            unseen.append(rest)
    return unseen


def _fitted_directions(evidence: Evidence) -> Vector:
    """Return (k, 3) unit vectors, calibrated: the direction that pointed down in each rest of the fitted recording."""
    r, fit = evidence.recording, evidence.fit
    if fit is None or evidence.flat is None:
        return np.zeros((0, 3))
    rests = evidence.rests
    means = statistics(r.acc, rests[rests[:, 1] - rests[:, 0] >= REST_S * r.rate_hz])[0]
    return -units(np.asarray(np.linalg.solve(fit.D, (means - fit.b_a).T).T, np.float64))


def judge_verification(
    rests: Sequence[NewOrientation],
    unseen: Sequence[NewOrientation],
    of: int,
    recording: Recording,
    contradiction: Reason | None,
) -> Checked:
    """Return whether the rests agree with the first calibration, and the likeliest reason where they do not.

    Where they agree, the calibration may still not be verified: fewer than `of` orientations are unseen, or they could
    not have shown an error for which a calibration is refused.

    Parameters
    ----------
    rests : all since the fit. unseen : those of them that the fit has not seen.
    contradiction : how the rests of the turning contradict each other; None where they agree.
    """
    # An orientation that the fit has seen cannot verify it, but it can refute it.
    shown = [rest for rest in rests if any(rest is other for other in unseen) or not rest.agrees]
    t_s, number_of = float(recording.t[-1]), max(of, len(shown))
    verifications = tuple(_verification(rest, i + 1, number_of, t_s) for i, rest in enumerate(shown))
    against, agrees, doubtful = _find_reason(rests, shown, recording, contradiction), None, False
    if against is not None:
        agrees, doubtful = False, not against.refuse and all(rest.agrees for rest in shown)
    elif rests and all(rest.clipped for rest in rests):
        against = reason("verification_failed", "lost")
    elif len(unseen) < of:
        against = reason("verification_failed", "too_few", number=len(unseen), of=of)
    elif (least := max(MOST_STD * rest.magnitude_std for rest in unseen)) > USABLE_RMS_MPS2:
        against, doubtful = reason("verification_failed", "unsure", least=least), True
    else:
        return Checked(verifications, True)
    return Checked(verifications, agrees, against.about(recording.sensor.origin), doubtful)


def _find_reason(
    rests: Sequence[NewOrientation], shown: Sequence[NewOrientation], recording: Recording, contradiction: Reason | None
) -> Reason | None:
    """Return the reason that explains most of the disagreement; None where there is none."""
    warmer = _temperature_change_c(recording)
    if abs(warmer) > MOST_CHANGE_C:
        how = "rose" if warmer > 0 else "fell"
        if recording.sensor.origin is Origin.VEHICLE:
            return reason("temperature_moved", "of_vehicle_since_flat", how=how, change=abs(warmer))
        return reason("temperature_moved", "since_flat", how=how, change=abs(warmer))
    if rests and all(rest.clipped for rest in rests) and recording.gyr_clipped.any():
        return reason("gyro_clipped", "every_turn")
    agree = all(rest.agrees for rest in shown)
    if not agree and is_much_clipped(recording):
        return reason("gyro_clipped", "disagreement")
    if contradiction is not None:
        return explain_contradiction(contradiction, recording)
    return None if agree else _explain_disagreement(shown, recording)


def explain_contradiction(contradiction: Reason, recording: Recording) -> Reason:
    """Return a contradiction with its likeliest cause: a knock, where the accelerometer clipped."""
    if recording.acc_clipped.any():
        return reason("inconsistent", "knock", contradiction=contradiction.what)
    return contradiction


def is_much_clipped(recording: Recording) -> bool:
    """Return True if turns beyond the gyroscope's range are frequent enough to explain a misfit."""
    return bool(recording.gyr_clipped.mean() > MUCH_CLIPPED)


def _explain_disagreement(rests: Sequence[NewOrientation], recording: Recording) -> Reason:
    """Return the likeliest fault of a sensor that disagrees with its first calibration."""
    magnitudes = [rest for rest in rests if not rest.magnitude_agrees]
    directions = [rest for rest in rests if not rest.direction_agrees]
    if directions and not magnitudes:
        scale = _find_scale_error(directions)
        if scale is not None:
            axis, share = scale
            return reason("verification_failed", "gyroscope", axis=axis, share=abs(share))
        worst = max(directions, key=lambda rest: rest.direction)
        miss, std = np.rad2deg([worst.direction, worst.direction_std])
        return reason("verification_failed", "direction", miss=miss, std=std)
    worst = max(magnitudes, key=lambda rest: abs(rest.magnitude))
    knock = " after a knock" if recording.acc_clipped.any() else ""
    return reason("verification_failed", "magnitude", error=worst.magnitude, knock=knock, std=worst.magnitude_std)


def _find_scale_error(rests: Sequence[NewOrientation]) -> tuple[str, float] | None:
    """Return the axis about which all turns are wrong by the same share, and the share; None if there is no such axis.

    The share minimises |miss - share * turn|^2 along the axis about which the board was turned most.
    """
    long = [rest for rest in rests if np.linalg.norm(rest.turn) > LONG_TURN_RAD]
    if len(long) < 2:
        return None
    turn, miss = np.array([rest.turn for rest in long]), np.array([rest.miss for rest in long])
    axis = int(np.abs(turn).sum(0).argmax())
    share = float((turn[:, axis] @ miss[:, axis]) / (turn[:, axis] @ turn[:, axis]))
    left = miss - share * np.outer(turn[:, axis], np.eye(3)[axis])
    if abs(share) < 0.01 or np.linalg.norm(left) > 0.3 * np.linalg.norm(miss):
        return None
    return AXES[axis], share


def _temperature_change_c(recording: Recording) -> float:
    """Return the median of the last second minus that of the first one; 0 where the temperature is not known."""
    known = recording.temperature_c[np.isfinite(recording.temperature_c)]
    n = max(round(recording.rate_hz), 1)
    return float(np.median(known[-n:]) - np.median(known[:n])) if len(known) > n else 0.0


def _verification(rest: NewOrientation, number: int, of: int, t_s: float) -> Verification:
    direction_deg, std_deg = np.rad2deg([rest.direction, rest.direction_std]).tolist()
    known = f"1 sigma {std_deg:.2f}"
    if rest.clipped:
        known = "not judged: on the way samples were lost or late, or the gyroscope clipped"
    text = (
        f"new orientation {number} of {of}: |a| error {rest.magnitude:+.3f} m/s² (1 sigma {rest.magnitude_std:.3f}),"
        f" direction error {direction_deg:.2f} deg ({known})"
    )
    magnitude = rest.magnitude, rest.magnitude_std
    return Verification(t_s, number, of, triple(rest.down), *magnitude, direction_deg, std_deg, rest.agrees, text)


def add_verification(calibration: Calibration, checked: Checked | None) -> Calibration:
    """Return the final calibration with `quality.verification`, its reason and its verdict.

    The verdict is `refused` where the new orientations disagree, and `usable` at most where none was shown. Without a
    verification (the source ended, the person had enough) the calibration stays as it is.
    """
    if checked is None:
        return calibration
    orientations = [{key: getattr(verification, key) for key in _IN_DOCUMENT} for verification in checked.verifications]
    quality: Quality = {
        **calibration.quality,
        "verification": {"agrees": checked.agrees, "orientations": orientations},
    }
    if checked.reason is not None:
        refused = checked.agrees is not None or quality["verdict"] == REFUSED
        reasons = _reasons_of_both(checked.reason, bool(checked.verifications), quality["reasons"])
        quality = {**quality, "verdict": REFUSED if refused else USABLE, "reasons": reasons}
    return replace(calibration, quality=quality)


def _reasons_of_both(first: Reason, verified: bool, final: Sequence[ReasonFound]) -> list[ReasonFound]:
    """Return the reason against the first fit or its verification, and those against the final fit, without conflict.

    The final fit has seen more: it knows better how the sensor changed, unless the first one was compared with new
    orientations.
    """
    reasons = [first.document(), *(each for each in final if each["code"] != first.code)]
    knows_better = not verified and first.code in (FEW, *CONTRADICTIONS)
    if knows_better and any(each["code"] in CONTRADICTIONS for each in final):
        reasons = list(final)
    codes = {each["code"] for each in reasons}
    return [each for each in reasons if not is_explained(each["code"], codes)]
