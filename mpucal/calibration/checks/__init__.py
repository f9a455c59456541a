"""What speaks against an estimate: one function a check, which gives a Reason of mpucal/reasons.py or None.

unusable     before there is a fit: wrong units, no rest, no turn, a dead axis
recording    moved while still, clipped, lost, warming or vibrating
bits         low or high bits of an axis that never move
gravity      a gravity that no place on Earth has
sensor       wrong range, units, axes or gyroscope, by a trustworthy fit
clock        a bus whose clock is off, or not known; sensors of which one lags behind the other
estimate     directions not observable, no convergence, contradictions, a change midway
"""

from __future__ import annotations

from collections.abc import Callable

from ...reasons import Reason
from ..evidence import Evidence
from . import bits, clock, estimate, gravity, recording, sensor, unusable

Check = Callable[[Evidence], Reason | None]

UNUSABLE: tuple[Check, ...] = (
    unusable.time_unit,
    unusable.accelerometer_unit,
    unusable.same_magnitude,
    unusable.gyroscope_unit,
    unusable.never_still,
    unusable.hardly_turned,
    unusable.dead_accelerometer,
    unusable.dead_gyroscope,
)

CHECKS: tuple[Check, ...] = (
    recording.moved_while_still,
    estimate.tilted_only,
    estimate.few_orientations,
    recording.gyro_clipped,
    recording.accel_clipped,
    recording.data_lost,
    sensor.wrong_range,
    sensor.accelerometer_factor,
    sensor.axes,
    sensor.gyro_off,
    recording.temperature_moved,
    recording.vibrating,
    gravity.gravity_unlikely,
    bits.bits_stuck,
    clock.clock_off,
    clock.apart,
    estimate.not_converged,
    estimate.inconsistent,
    estimate.changed_midway,
    estimate.zero_moved,
    estimate.parts_disagree,
)

# what is asked of an estimate from the rests alone: neither gaps nor the gyroscope spoil it
OF_GYROSCOPE = (unusable.gyroscope_unit, unusable.dead_gyroscope)
OF_RESTS: tuple[Check, ...] = tuple(
    check
    for check in CHECKS
    if check
    not in (recording.gyro_clipped, recording.data_lost, sensor.axes, sensor.gyro_off, clock.clock_off, clock.apart)
)


def gyroscope_at_fault(evidence: Evidence) -> Reason | None:
    """Return why the gyroscope cannot be used: none recorded, dead, of another range, or contradicted by the rests."""
    for check in (unusable.no_gyroscope, unusable.dead_gyroscope, sensor.gyro_range, sensor.gyro_contradicts):
        if (at_fault := check(evidence)) is not None:
            return at_fault
    return None


def find_reasons(evidence: Evidence) -> list[Reason]:
    """Return all that speaks against an estimate, what refuses it first."""
    if evidence.model == "static":
        # unusable accelerations are unusable without a gyroscope, too
        checks = (*(check for check in UNUSABLE if check not in OF_GYROSCOPE), *OF_RESTS)
        reasons = [] if evidence.gyroscope is None else [evidence.gyroscope]
    else:
        # of a gyroscope that is not there, or whose rates are another range's, nothing else can be said
        nothing_else = unusable.no_gyroscope(evidence) or sensor.gyro_range(evidence)
        if nothing_else is not None:
            return [nothing_else]
        # a fit there is only where nothing made the recording unusable
        checks, reasons = CHECKS if evidence.fit is not None else (*UNUSABLE, *CHECKS), []
    reasons += [reason for check in checks if (reason := check(evidence)) is not None]
    return sorted(reasons, key=lambda reason: not reason.refuse)


def unusable_for_a_fit(evidence: Evidence) -> bool:
    """Whether nothing can be estimated."""
    return any(check(evidence) is not None for check in UNUSABLE)
