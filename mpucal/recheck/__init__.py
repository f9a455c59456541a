"""Check of a calibration against its sensor, by a short recording of rests and the turns between them."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from ..data import Recording, Vector
from ..origin import name_thing
from ..result.calibration import Calibration
from ..result.comparison import CONFIDENCE
from ..result.correction import make_correction, other_who_am_i, same_trim
from . import drift
from .hypotheses import NOTHING, HypothesisOdds, compare_hypotheses, estimate, p_value
from .observed import LEAST_ORIENTATIONS, NOISE, Observations, apply_errors, observe
from .outcome import (
    ANOTHER_SENSOR,
    CANNOT_BE_TOLD,
    DRIFTED,
    REMOUNTED,
    STILL_GOOD,
    Change,
    CheckResult,
    changes_of,
)

__all__ = ["CheckResult", "check"]

# A calibration is called still good only if the bias is known to this standard uncertainty.
MOST_BIAS_STD_MG = 2.5
# Hypotheses whose log odds differ by less (20 to 1) are both named.
NEAR_LOG_ODDS = 3.0
# Below this p-value under any hypothesis the rests contradict each other: the board was not at rest.
LEAST_P_VALUE = 1e-6
VERDICTS = {"mount": REMOUNTED, "another sensor": ANOTHER_SENSOR}
REPEAT = "lay the board flat for 10 s, then hold it for 2 s in three orientations 20 deg or more apart"
CALIBRATE_AGAIN = "calibrate it again, with `mpucal session`"


def check(calibration: Calibration, recording: Recording, days: float | None = None) -> CheckResult:
    """Return whether `calibration` is still right for the sensor that made `recording`.

    The prior is the calibration's own uncertainty and the ageing of unchanged sensors. The rests of the recording, and
    the turns between them, are the evidence for a change of the bias, of the scale factors, of the mount, of the
    gyroscope, of the noise or of the temperature, or for another sensor. A sensor that did not change is called changed
    in 1 of 100 checks.

    Parameters
    ----------
    calibration : of one sensor, not refused. recording : a rest, lying flat, and three or more in other orientations.
    days : time between them; None: by their dates.

    Raises
    ------
    UsageError : the calibration was refused, or is of samples of another kind (a chip's own, an autopilot's stream).
    """
    result, origin = _check(calibration, recording, days), recording.sensor.origin
    return replace(result, message=name_thing(result.message, origin), remedy=name_thing(result.remedy, origin))


def _check(calibration: Calibration, recording: Recording, days: float | None) -> CheckResult:
    then, now = calibration.sensor, recording.sensor
    if message := other_who_am_i(then.who_am_i, now.who_am_i):
        return CheckResult(ANOTHER_SENSOR, "another sensor", message, CALIBRATE_AGAIN)
    if same_trim(then, now) is False and not np.any(calibration.applied_in_hardware):
        message = (
            f"its offset registers hold {now.accel_offsets}, and the calibrated one's held {then.accel_offsets}:"
            " the factory sets them for each chip"
        )
        remedy = f"{CALIBRATE_AGAIN}, or give calibration-on-chip.json if `mpucal write` left one"
        return CheckResult(ANOTHER_SENSOR, "another sensor", message, remedy)
    ready = make_correction(calibration, now, recording.autopilot).calibration
    observed = observe(recording, ready)
    if observed is None:
        return CheckResult(CANNOT_BE_TOLD, NOTHING, "the board never rested", REPEAT)
    return _assess(ready, recording, observed, days_since(calibration, recording.utc_ns) if days is None else days)


def _assess(calibration: Calibration, recording: Recording, observed: Observations, days: float) -> CheckResult:
    T_0, T = calibration.sensor.temperature_c, observed.temperature_c
    change_c = None if T_0 is None or T is None else T - T_0
    hypotheses = drift.hypotheses(calibration, change_c)
    nothing = drift.own_uncertainty(calibration) + drift.ageing(calibration, days, change_c)
    anything = nothing + sum(added for _, added in hypotheses.values())
    if p_value(observed, anything) < LEAST_P_VALUE:
        observed = _relinearise(observed, recording, calibration, anything)
    comparison = compare_hypotheses(observed, nothing, hypotheses)
    likeliest = comparison.likeliest
    explains = None
    if likeliest != NOTHING:
        if drift.TEMPERATURE in hypotheses:
            explains = p_value(observed, nothing + hypotheses[drift.TEMPERATURE][1]) > 1.0 - CONFIDENCE
        P = nothing + hypotheses[likeliest][1]
        theta, covariance = estimate(_relinearise(observed, recording, calibration, P), P)
    else:
        theta, covariance = estimate(observed, nothing)
    result = CheckResult(
        VERDICTS.get(likeliest, DRIFTED if likeliest != NOTHING else STILL_GOOD),
        likeliest,
        "",
        changes=changes_of(calibration, theta, covariance),
        or_also=_close_hypotheses(comparison),
        probability=comparison.probability,
        log_odds=comparison.log_odds,
        temperature_change_c=change_c,
        temperature_explains=explains,
        orientations=observed.orientations,
        seconds=observed.seconds,
        theta=theta,
        covariance=covariance,
    )
    if p_value(observed, anything) < LEAST_P_VALUE:
        message = "the rests contradict each other: no change of the sensor explains them"
        return replace(result, verdict=CANNOT_BE_TOLD, message=message, remedy=f"away from vibration, {REPEAT}")
    if likeliest != NOTHING:
        return _describe_change(result)
    return _describe_unchanged(
        result, changes_of(calibration, *estimate(observed, nothing + hypotheses["bias"][1]))["bias"]
    )


def _relinearise(observed: Observations, recording: Recording, calibration: Calibration, P: Vector) -> Observations:
    """Return the observations linearised about their estimate: a large change is beyond first order."""
    theta, _ = estimate(observed, P)
    again = observe(recording, apply_errors(calibration, theta))
    return observed if again is None else replace(again, r=again.r + again.J @ theta)


def _describe_unchanged(result: CheckResult, bias: Change) -> CheckResult:
    """Return the result for an unchanged sensor: still good, if enough was seen to tell.

    bias : its change, estimated with the prior of a changed bias.
    """
    axis = int(np.argmax(bias.std))
    if result.orientations < LEAST_ORIENTATIONS:
        message = f"the samples show {result.orientations} of the {LEAST_ORIENTATIONS} orientations that are needed"
        remedy = REPEAT
    elif bias.std[axis] > MOST_BIAS_STD_MG:
        message = f"the bias of {'xyz'[axis]} is known to {bias.std[axis]:.1f} mg only (1 sigma)"
        remedy = f"hold the board in further orientations, also with side +{'XYZ'[axis]} or −{'XYZ'[axis]} down"
    else:
        far = int(np.argmax(np.abs(bias.value)))
        within = f"{abs(bias.value[far]):.1f} mg of the calibrated value (1 sigma {bias.std[far]:.1f})"
        return replace(result, message=f"the bias is within {within}")
    return replace(result, verdict=CANNOT_BE_TOLD, message=message, remedy=remedy)


def _describe_change(result: CheckResult) -> CheckResult:
    changes = result.changes or {}
    also = f" (or {', or '.join(result.or_also)}: these orientations cannot tell)" if result.or_also else ""
    by_T = ""
    if result.temperature_explains is not None and result.temperature_change_c is not None:
        does = "explains" if result.temperature_explains else "does not explain"
        by_T = f"; the temperature, {result.temperature_change_c:+.1f} °C since the calibration, {does} it"
    match result.what:
        case "temperature":
            message = f"bias {changes['bias'].text()} mg{also}{by_T}"
            remedy = "take the updated calibration (-o DIR), or measure b_a(T) with `mpucal merge`"
        case "another sensor":
            message, remedy = f"more has changed than does in one sensor{also}", CALIBRATE_AGAIN
        case "mount":
            message = f"the accelerometer has turned against the gyroscope by {changes['mount'].text()} deg{also}"
            remedy = CALIBRATE_AGAIN
        case "noise":
            accelerometer, gyroscope = np.exp(np.zeros(2) if result.theta is None else result.theta[NOISE])
            times = f"{accelerometer:.2g} times on the accelerometer, {gyroscope:.2g} times on the gyroscope"
            message = f"the noise at rest is not the calibration's: {times}{also}"
            remedy = f"check supply, wiring and filter bandwidth; if the table shook, {REPEAT}"
        case what:
            change = changes[what]
            message = f"{what} {change.text()} {change.unit}{also}{by_T}"
            remedy = "take the updated calibration (-o DIR)" if result.only_biases else CALIBRATE_AGAIN
    return replace(result, message=message, remedy=remedy)


def _close_hypotheses(comparison: HypothesisOdds) -> tuple[str, ...]:
    """Return the hypotheses that are nearly as likely as the likeliest."""
    best, log_odds = comparison.likeliest, comparison.log_odds
    if best == NOTHING:
        return ()
    least = max(log_odds[best] - NEAR_LOG_ODDS, 0.0)
    return tuple(name for name, odds in log_odds.items() if name != best and odds > least)


def days_since(calibration: Calibration, utc_ns: int | None = None) -> float:
    """Return the days from the calibration to `utc_ns`, or to now; 0 if the calibration has no date."""
    try:
        made = datetime.fromisoformat(calibration.created)
    except ValueError:
        return 0.0
    made = made if made.tzinfo else made.replace(tzinfo=UTC)
    then = datetime.now(UTC) if utc_ns is None else datetime.fromtimestamp(utc_ns * 1e-9, UTC)
    return max((then - made).total_seconds() / 86400.0, 0.0)
