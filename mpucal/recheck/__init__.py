"""Whether a calibration is still right for its sensor: from a short recording of rests and the turns between them."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from ..data import Recording, Sensor, Vector
from ..result.calibration import Calibration
from ..result.correction import correction
from . import drift
from .hypotheses import NOTHING, Weighed, estimate, fits, weigh
from .observed import Observed, changed, observe
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

# flat, and three more
LEAST_ORIENTATIONS = 4
# a bias that is known to no better than this is not known to be the same
ENOUGH_MG = 2.5
# two hypotheses nearer than this (20 to 1) are not told apart
NEAR = 3.0
# what less likely a sensor shows by chance is no sensor at rest
CONTRADICTION = 1e-6
SURPRISE = 0.01
VERDICTS = {"mount": REMOUNTED, "another sensor": ANOTHER_SENSOR}
AGAIN = "lay the board flat for 10 s, then hold it for 2 s in three orientations 20 deg or more apart"
ANEW = "calibrate it anew, with `mpucal session`"


def check(calibration: Calibration, recording: Recording, days: float | None = None) -> CheckResult:
    """Whether `calibration` is still right for the sensor that made `recording`.

    The prior is what the calibration says of its own uncertainty, and what unchanged sensors do as they age; what the
    rests of the recording and the turns between them show is weighed for and against a change of the bias, of the
    scale factors, of the mount, of the gyroscope, of the temperature, and another sensor. A sensor that did not change
    is called changed in 1 of 100 checks.

    Parameters
    ----------
    calibration : of one sensor, not refused. recording : a rest, lying flat, and three or more in other orientations.
    days : from the one to the other; None: by their dates.

    Raises
    ------
    UsageError : the calibration was refused, or is of samples of another kind (a chip's own, an autopilot's stream).
    """
    of, now = calibration.sensor, recording.sensor
    if None not in (of.who_am_i, now.who_am_i) and of.who_am_i != now.who_am_i:
        said = f"it answers 0x{now.who_am_i:02x} to WHO_AM_I, and the calibrated one answered 0x{of.who_am_i:02x}"
        return CheckResult(ANOTHER_SENSOR, "another sensor", said, ANEW)
    if _trimmed_otherwise(calibration, now):
        said = (
            f"its offset registers hold {now.accel_offsets}, and the calibrated one's held {of.accel_offsets}:"
            " the factory sets them for each chip"
        )
        return CheckResult(ANOTHER_SENSOR, "another sensor", said, f"{ANEW}, or give calibration-on-chip.json")
    ready = correction(calibration, now, recording.autopilot).calibration
    observed = observe(recording, ready)
    if observed is None:
        return CheckResult(CANNOT_BE_TOLD, NOTHING, "the board never rested", AGAIN)
    return _weighed_up(ready, recording, observed, days_since(calibration, recording.utc_ns) if days is None else days)


def _weighed_up(calibration: Calibration, recording: Recording, observed: Observed, days: float) -> CheckResult:
    T_0, T = calibration.sensor.temperature_c, observed.temperature_c
    change_c = None if T_0 is None or T is None else T - T_0
    happenings = drift.happenings(calibration, change_c)
    nothing = drift.own_uncertainty(calibration) + drift.ageing(calibration, days, change_c)
    anything = nothing + sum(added for _, added in happenings.values())
    if fits(observed, anything) < CONTRADICTION:
        observed = _nearer(observed, recording, calibration, anything)
    weighed = weigh(observed, nothing, happenings)
    told = weighed.told
    explains = None
    if told != NOTHING:
        if drift.TEMPERATURE in happenings:
            explains = fits(observed, nothing + happenings[drift.TEMPERATURE][1]) > SURPRISE
        P = nothing + happenings[told][1]
        theta, covariance = estimate(_nearer(observed, recording, calibration, P), P)
    else:
        theta, covariance = estimate(observed, nothing)
    result = CheckResult(
        VERDICTS.get(told, DRIFTED if told != NOTHING else STILL_GOOD),
        told,
        "",
        changes=changes_of(calibration, theta, covariance),
        or_also=_or_also(weighed),
        probability=weighed.probability,
        log_odds=weighed.log_odds,
        temperature_change_c=change_c,
        temperature_explains=explains,
        orientations=observed.orientations,
        seconds=observed.seconds,
        theta=theta,
        covariance=covariance,
    )
    if fits(observed, anything) < CONTRADICTION:
        said = "the rests contradict each other, whatever happened to the sensor"
        return replace(result, verdict=CANNOT_BE_TOLD, message=said, remedy=f"away from what moves, {AGAIN}")
    if told != NOTHING:
        return _changed(result)
    return _unchanged(result, changes_of(calibration, *estimate(observed, nothing + happenings["bias"][1]))["bias"])


def _nearer(observed: Observed, recording: Recording, calibration: Calibration, P: Vector) -> Observed:
    """The same observations, linear about their estimate: a large change is beyond first order."""
    theta, _ = estimate(observed, P)
    again = observe(recording, changed(calibration, theta))
    return observed if again is None else replace(again, r=again.r + again.J @ theta)


def _unchanged(result: CheckResult, bias: Change) -> CheckResult:
    """Nothing speaks for a change: if enough was seen, that is good news. bias : its change by the check alone."""
    axis = int(np.argmax(bias.std))
    if result.orientations < LEAST_ORIENTATIONS:
        said, remedy = f"{result.orientations} orientations were seen, and {LEAST_ORIENTATIONS} are needed", AGAIN
    elif bias.std[axis] > ENOUGH_MG:
        said = f"the bias of {'xyz'[axis]} is known to {bias.std[axis]:.1f} mg only (1 sigma)"
        remedy = f"hold the board in further orientations, also with side +{'XYZ'[axis]} or −{'XYZ'[axis]} down"
    else:
        far = int(np.argmax(np.abs(bias.value)))
        within = f"{abs(bias.value[far]):.1f} mg of what it was (1 sigma {bias.std[far]:.1f})"
        return replace(result, message=f"the bias is within {within}")
    return replace(result, verdict=CANNOT_BE_TOLD, message=said, remedy=remedy)


def _changed(result: CheckResult) -> CheckResult:
    changes = result.changes or {}
    also = f" (or {', or '.join(result.or_also)}: these orientations do not tell)" if result.or_also else ""
    by_T = ""
    if result.temperature_explains is not None and result.temperature_change_c is not None:
        does = "explains" if result.temperature_explains else "does not explain"
        by_T = f"; the temperature, {result.temperature_change_c:+.1f} °C since the calibration, {does} it"
    match result.what:
        case "temperature":
            said = f"bias {changes['bias'].said()} mg{also}{by_T}"
            remedy = "take the updated calibration (-o DIR), or measure b_a(T) with `mpucal merge`"
        case "another sensor":
            said, remedy = f"more of it changed than one sensor's does{also}", ANEW
        case "mount":
            said = f"the accelerometer has turned against the gyroscope by {changes['mount'].said()} deg{also}"
            remedy = ANEW
        case what:
            change = changes[what]
            said = f"{what} {change.said()} {change.unit}{also}{by_T}"
            remedy = "take the updated calibration (-o DIR)" if result.only_biases else ANEW
    return replace(result, message=said, remedy=remedy)


def _or_also(weighed: Weighed) -> tuple[str, ...]:
    if weighed.told == NOTHING:
        return ()
    best = weighed.log_odds[weighed.told]
    return tuple(
        name for name, odds in weighed.log_odds.items() if name != weighed.told and odds > max(best - NEAR, 0.0)
    )


def _trimmed_otherwise(calibration: Calibration, sensor: Sensor) -> bool:
    """Whether the offset registers are those of another chip; their bits 0 do nothing."""
    held = calibration.sensor.accel_offsets, sensor.accel_offsets
    if held[0] is None or held[1] is None or np.any(calibration.applied_in_hardware):
        return False
    return any((one ^ other) & ~1 for one, other in zip(held[0], held[1], strict=True))


def days_since(calibration: Calibration, utc_ns: int | None = None) -> float:
    """From the calibration to a time, or to now; 0 where nobody knows."""
    try:
        made = datetime.fromisoformat(calibration.created)
    except ValueError:
        return 0.0
    made = made if made.tzinfo else made.replace(tzinfo=UTC)
    then = datetime.now(UTC) if utc_ns is None else datetime.fromtimestamp(utc_ns * 1e-9, UTC)
    return max((then - made).total_seconds() / 86400.0, 0.0)
