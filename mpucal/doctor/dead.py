"""Axes that do not measure: their counts do not change, whatever they should show.

Noise moves the last bits of every axis of these chips (2 mg and 0.03 deg/s at 44 Hz, where a count is 0.12 mg and
0.015 deg/s), and of the thermometer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from ..data import Mask, Recording, Vector
from .finding import Finding, Mark

DEAD_AXIS = "dead axis"
REPLACE = "replace the chip; first check its supply and solder joints, and start it once more"


def live_axes(values: Vector) -> Mask:
    """(3,) True where an axis of `values` (n, 3) changes at all."""
    return np.asarray(np.ptp(values, axis=0) > 0)


def dead_axes(recording: Recording) -> Finding | None:
    """The axes that stood still for the whole recording; None where all live."""
    stood = []
    for sensor, values, clipped in (
        ("accelerometer", recording.acc, recording.acc_clipped),
        ("gyroscope", recording.gyr, recording.gyr_clipped),
    ):
        live = live_axes(values)
        for axis, value in zip("xyz", values[0], strict=True):
            if not live["xyz".index(axis)]:
                where = "zero" if value == 0 else "the end of its range" if clipped.all() else f"{value:.4g}"
                stood.append((where, f"{sensor} {axis}"))
    celsius = recording.temperature_c
    if np.isfinite(celsius).all() and np.ptp(celsius) == 0:
        stood.append((f"{celsius[0]:.1f} °C", "the thermometer"))
    if not stood:
        return None
    by_place: dict[str, list[str]] = {}
    for where, axis in stood:
        by_place.setdefault(where, []).append(axis)
    what = "; ".join(f"{', '.join(axes)} stayed at {where}" for where, axes in by_place.items())
    return Finding(DEAD_AXIS, Mark.BAD, what, REPLACE, {"dead": [axis for _, axis in stood]})


def named(sensors: Mapping[str, NDArray[np.float64]], dead: Callable[[float], bool]) -> str:
    """The axes of each sensor (3,) for which `dead` holds, in words; empty where it holds for none."""
    return ", ".join(
        f"{sensor} {axis}"
        for sensor, values in sensors.items()
        for axis, value in zip("xyz", values.tolist(), strict=True)
        if dead(value)
    )
