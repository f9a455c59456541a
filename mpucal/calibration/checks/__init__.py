"""Table of what may be wrong with a recording or its estimate; each row finds a Reason of mpucal/reasons.py, or None.

unusable     no estimate is possible: wrong units, no rest, no turn, a dead axis
recording    moved while flat, clipped, lost, frozen, warming or vibrating; a gravity not found on Earth
bits         low or high bits of an axis that never change, a low byte that was taken for signed
sensor       wrong range, units, axes, gyroscope or clock, by a trustworthy fit
estimate     directions not observable, no convergence, contradictions, a change midway
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Literal, NamedTuple

from ...reasons import Reason, is_explained
from ..evidence import Evidence, once
from . import bits, estimate, recording, sensor, unusable
from .sensor import is_trustworthy


class Row(NamedTuple):
    """Row of the table.

    Attributes
    ----------
    find : returns why the recording, or its estimate, is wrong. needs : without this it finds nothing.
    unusable : nothing can be estimated then. of_gyroscope : an estimate from the rests alone does not suffer from it.
    """

    find: Callable[[Evidence], Reason | None]
    needs: Literal["", "flat", "fit", "trustworthy fit"] = ""
    unusable: bool = False
    of_gyroscope: bool = False

    def reason(self, e: Evidence) -> Reason | None:
        """Return the reason that this row finds."""
        if (self.needs == "flat" and e.flat is None) or (self.needs.endswith("fit") and e.fit is None):
            return None
        return None if self.needs == "trustworthy fit" and not is_trustworthy(e) else self.find(e)


TABLE = (
    Row(unusable.time_unit, unusable=True),
    Row(unusable.accelerometer_unit, unusable=True),
    Row(unusable.same_magnitude, unusable=True),
    Row(unusable.gyroscope_unit, unusable=True, of_gyroscope=True),
    Row(unusable.never_still, unusable=True),
    Row(unusable.hardly_turned, "flat", unusable=True),
    Row(unusable.two_sensors, "flat", unusable=True),
    Row(unusable.dead_accelerometer, "flat", unusable=True),
    Row(unusable.dead_gyroscope, "flat", unusable=True, of_gyroscope=True),
    Row(recording.moved_while_still, "flat"),
    Row(estimate.tilted_only, "fit"),
    Row(estimate.few_orientations, "fit"),
    Row(partial(recording.clipped, "gyro_clipped", "gyr_clipped"), of_gyroscope=True),
    Row(partial(recording.clipped, "accel_clipped", "acc_clipped")),
    Row(recording.data_lost, of_gyroscope=True),  # gaps do not spoil rests
    Row(recording.gyroscope_frozen, of_gyroscope=True),
    Row(sensor.scale_factors, "trustworthy fit"),
    Row(sensor.axes, "trustworthy fit", of_gyroscope=True),
    Row(sensor.gyro_off, "trustworthy fit", of_gyroscope=True),
    Row(recording.temperature_moved),
    Row(recording.vibrating, "fit"),
    Row(recording.gravity_unlikely),
    Row(bits.low_byte_signed),
    Row(bits.bits_stuck),
    Row(sensor.clock_off, of_gyroscope=True),
    Row(sensor.sensors_lag, "fit", of_gyroscope=True),
    Row(estimate.smoothed, "fit"),
    Row(estimate.not_converged, "fit"),
    Row(estimate.inconsistent, "fit"),
    Row(estimate.contradiction, "fit"),
)

# Faults of the gyroscope, for which the rests alone may give an estimate. Without rates, or with rates of another
# range, the other rows mean nothing.
NO_GYROSCOPE, OTHER_RANGE = Row(unusable.no_gyroscope), Row(sensor.gyro_range, "fit")
CONTRADICTED = Row(sensor.gyro_contradicts, "fit")
AT_FAULT = (
    NO_GYROSCOPE,
    Row(unusable.dead_gyroscope, "flat"),
    OTHER_RANGE,
    CONTRADICTED,
    Row(sensor.sensors_lag, "fit"),
)


def find_gyroscope_fault(e: Evidence) -> Reason | None:
    """Return why the gyroscope may be of no use: not recorded, dead, of another range, contradicted, of other times."""
    return next(_found(e, AT_FAULT), None)


@once
def find_reasons(e: Evidence) -> list[Reason]:
    """Return all reasons against an estimate that no other explains, those that refuse it first."""
    of_rests = e.model == "static"
    if not of_rests and (only := [*_found(e, (NO_GYROSCOPE, OTHER_RANGE))]):
        return [only[0], *e.against_rests]
    # A fit with the gyroscope exists only where the recording is usable.
    rows = [row for row in TABLE if not (row.of_gyroscope if of_rests else row.unusable and e.fit is not None)]
    reasons = [known for known in (e.gyro_fault, e.changed) if known is not None] + [*_found(e, rows)]
    codes = {each.code for each in reasons}
    return sorted((each for each in reasons if not is_explained(each.code, codes)), key=lambda each: not each.refuse)


def is_unusable(e: Evidence) -> bool:
    """Return True if nothing can be estimated from the recording."""
    rows = [row for row in TABLE if row.unusable and not (row.of_gyroscope and e.model == "static")]
    return any(True for _ in _found(e, rows))


def _found(e: Evidence, rows: Iterable[Row]) -> Iterator[Reason]:
    return (reason for row in rows if (reason := row.reason(e)) is not None)
