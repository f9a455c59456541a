"""The noise of a sensor at rest as a density, whatever its low-pass filter."""

from __future__ import annotations

import numpy as np

from ..data import Vector

# above slow drift, below a low-pass filter of 44 Hz; a hand trembles in the lower one only
LOW_HZ, HIGH_HZ = (1.0, 12.0), (20.0, 40.0)
TREMBLES = 2.0


def density(values: Vector, rate_hz: float, band_hz: tuple[float, float] = HIGH_HZ) -> Vector:
    """(3,) unit/sqrt(Hz): the root of the mean one-sided spectrum of `values` (n, 3) within `band_hz`."""
    from scipy.signal import periodogram  # noqa: PLC0415 - slow to load

    hz, power = periodogram(values, rate_hz, window="hann", axis=0)
    inside = (band_hz[0] <= hz) & (hz <= band_hz[1])
    return np.asarray(np.sqrt(power[inside].mean(0)))


def trembles(values: Vector, rate_hz: float) -> bool:
    """Whether what made `values` (n, 3) was moved: noise alone is as dense below as above."""
    return bool((density(values, rate_hz, LOW_HZ) > TREMBLES * density(values, rate_hz)).any())
