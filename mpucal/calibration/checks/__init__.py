"""Checks of an estimate: each function returns a Reason of mpucal/reasons.py against it, or None.

unusable     no estimate is possible: wrong units, no rest, no turn, a dead axis
recording    moved while flat, clipped, lost, warming or vibrating; a gravity not found on Earth
bits         low or high bits of an axis that never change, a low byte that was taken for signed
sensor       wrong range, units, axes, gyroscope or clock, by a trustworthy fit
estimate     directions not observable, no convergence, contradictions, a change midway
"""

from __future__ import annotations

from collections.abc import Callable

from ...reasons import Reason
from ..evidence import Evidence
from . import bits, estimate, recording, sensor, unusable

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
    recording.gravity_unlikely,
    bits.low_byte_signed,
    bits.bits_stuck,
    sensor.clock_off,
    sensor.sensors_lag,
    estimate.not_converged,
    estimate.inconsistent,
    estimate.contradiction,
)

# An estimate from the rests alone does not use the gyroscope, and gaps do not spoil it.
NOT_OF_RESTS: tuple[Check, ...] = (
    unusable.gyroscope_unit,
    unusable.dead_gyroscope,
    recording.gyro_clipped,
    recording.data_lost,
    sensor.axes,
    sensor.gyro_off,
    sensor.clock_off,
    sensor.sensors_lag,
)


def find_gyroscope_fault(evidence: Evidence) -> Reason | None:
    """Return why the gyroscope cannot be used: not recorded, dead, of another range, or contradicted by the rests."""
    checks: tuple[Check, ...] = (
        unusable.no_gyroscope,
        unusable.dead_gyroscope,
        sensor.gyro_range,
        sensor.gyro_contradicts,
    )
    return next((fault for check in checks if (fault := check(evidence)) is not None), None)


def find_reasons(evidence: Evidence) -> list[Reason]:
    """Return all reasons against an estimate, those that refuse it first."""
    reasons = []
    if evidence.model == "static":
        checks = _suited(evidence, UNUSABLE + CHECKS)
        reasons = [] if evidence.gyroscope is None else [evidence.gyroscope]
    else:
        # Without a gyroscope, or with rates of another range, the other checks mean nothing.
        only = unusable.no_gyroscope(evidence) or sensor.gyro_range(evidence)
        if only is not None:
            return [only, *evidence.against_rests]
        # A fit exists only where the recording is usable.
        checks = [*CHECKS] if evidence.fit is not None else [*UNUSABLE, *CHECKS]
    reasons += [reason for check in checks if (reason := check(evidence)) is not None]
    return sorted(reasons, key=lambda reason: not reason.refuse)


def is_unusable(evidence: Evidence) -> bool:
    """Return True if nothing can be estimated from the recording."""
    return any(check(evidence) is not None for check in _suited(evidence, UNUSABLE))


def _suited(evidence: Evidence, checks: tuple[Check, ...]) -> list[Check]:
    return [check for check in checks if evidence.model != "static" or check not in NOT_OF_RESTS]
