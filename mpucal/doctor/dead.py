"""Axes that do not measure: their counts do not change, whatever they should show.

Noise moves the last bits of every axis of these chips (2 mg and 0.03 deg/s at 44 Hz, where a count is 0.12 mg and
0.015 deg/s), and of the thermometer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from ..data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Mask, Recording, Vector
from .finding import Finding, Mark

DEAD_AXIS, STUCK_BITS = "dead axis", "stuck bits"
REPLACE = "replace the chip; first check its supply and solder joints, and start it once more"
# an axis that dies midway: for how long it stands still, and how often one that lives would have changed
LONG_S, MANY_CHANGES = 2.0, 50.0


def live_axes(recording: Recording) -> tuple[Mask, Mask]:
    """Accelerometer's and gyroscope's (3,): True where an axis measures all the time."""
    acc, gyr = (
        np.array(
            [_standing(c, recording.rate_hz) is None and _held_byte(c, lsb, recording.rate_hz) is None for c in v.T]
        )
        for _, v, _, lsb in _sensors(recording)
    )
    return acc, gyr


def dead_axes(recording: Recording) -> Iterator[Finding]:
    """The axes that stood still, throughout or from some time on, and those of which only the high byte moves."""
    stood: dict[str, list[str]] = {}
    low: list[str] = []
    for sensor, values, clipped, lsb in _sensors(recording):
        for axis, column in zip("xyz", values.T, strict=True):
            where, part = _held_byte(column, lsb, recording.rate_hz), _standing(column, recording.rate_hz)
            if part is None and where is None:
                continue
            value = float(column[part or where][0])
            if part is None or (where is not None and value != 0.0 and not clipped[part].all()):
                low.append(f"{sensor} {axis}")
                continue
            at = "zero" if value == 0 else "the end of its range" if clipped[part].all() else f"{value:.4g}"
            since = recording.t[part.start] - recording.t[0]
            stood.setdefault(at + (f" from {since:.0f} s on" if part.start else ""), []).append(f"{sensor} {axis}")
    celsius = recording.temperature_c
    if np.isfinite(celsius).all() and np.ptp(celsius) == 0:
        stood.setdefault(f"{celsius[0]:.1f} °C", []).append("the thermometer")
    if stood:
        what = "; ".join(f"{', '.join(axes)} stayed at {where}" for where, axes in stood.items())
        data = {"dead": [axis for axes in stood.values() for axis in axes]}
        yield Finding(DEAD_AXIS, Mark.BAD, what, REPLACE, data)
    if low:
        what = f"the low byte of {', '.join(low)} stays 0: nothing but multiples of 256 counts"
        yield Finding(STUCK_BITS, Mark.BAD, what, REPLACE, {"low_byte": low})


def _sensors(recording: Recording) -> Iterator[tuple[str, Vector, Mask, float | None]]:
    """Each sensor's name, values, which are clipped, and what a count is, where that is known."""
    accel_g, gyro_dps = recording.sensor.accel_range_g, recording.sensor.gyro_range_dps
    mps2 = None if accel_g is None else accel_g * STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS
    rad_s = None if gyro_dps is None else float(np.radians(gyro_dps / GYRO_COUNTS))
    yield "accelerometer", recording.acc, recording.acc_clipped, mps2
    yield "gyroscope", recording.gyr, recording.gyr_clipped, rad_s


def _standing(column: Vector, rate_hz: float) -> slice | None:
    """Where an axis (n,) stood still: all the time, or for longer than one that changes as it did before does."""
    longest = _longest(np.diff(column) == 0)
    inside = longest.stop - longest.start
    if inside == len(column) - 1:
        return slice(0, len(column))
    changes = np.count_nonzero(np.diff(column)) / (len(column) - 1 - inside)
    surely = inside > LONG_S * rate_hz and inside * changes > MANY_CHANGES
    return slice(longest.start, longest.stop + 1) if surely else None


def _held_byte(column: Vector, lsb: float | None, rate_hz: float) -> slice | None:
    """Where the low byte of an axis (n,) stays 0 for long."""
    if lsb is None:
        return None
    longest = _longest(np.rint(column / lsb).astype(np.int64) & 0xFF == 0)
    return longest if longest.stop - longest.start > LONG_S * rate_hz else None


def _longest(holds: Mask) -> slice:
    """The longest stretch of (n,) in which it holds."""
    edges = np.flatnonzero(np.diff(holds.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    return slice(*edges[np.diff(edges, axis=1).argmax()].tolist()) if len(edges) else slice(0, 0)


def named(sensors: Mapping[str, NDArray[np.float64]], dead: Callable[[float], bool]) -> str:
    """The axes of each sensor (3,) for which `dead` holds, in words; empty where it holds for none."""
    return ", ".join(
        f"{sensor} {axis}"
        for sensor, values in sensors.items()
        for axis, value in zip("xyz", values.tolist(), strict=True)
        if dead(value)
    )
