"""The noise of a sensor at rest as a density, whatever its low-pass filter."""

from __future__ import annotations

import numpy as np

from ..data import Vector

# above slow drift, below a low-pass filter of 44 Hz; a hand trembles in the lower one only
LOW_HZ, HIGH_HZ = (1.0, 12.0), (20.0, 40.0)
TREMBLES = 2.0


def density(values: Vector, rate_hz: float, band_hz: tuple[float, float] = HIGH_HZ) -> Vector:
    """(3,) unit/sqrt(Hz): the root of the mean one-sided spectrum of `values` (n, 3) within `band_hz`."""
    hz, power = periodogram(values, rate_hz)
    inside = (band_hz[0] <= hz) & (hz <= band_hz[1])
    return np.asarray(np.sqrt(power[inside].mean(0)))


def periodogram(values: Vector, rate_hz: float) -> tuple[Vector, Vector]:
    """Frequencies (m,) [Hz], and the one-sided density of `values` (n, 3) at them, (m, 3) unit^2/Hz.

    Without the mean, through a Hann window, as scipy.signal.periodogram does; that takes a second to load.
    """
    n = len(values)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)
    power = np.abs(np.fft.rfft(window[:, None] * (values - values.mean(0)), axis=0)) ** 2
    # what is below zero, of all but zero itself and half the rate
    power[1 : (n + 1) // 2] *= 2.0
    return np.asarray(np.fft.rfftfreq(n, 1.0 / rate_hz), np.float64), power / (rate_hz * (window @ window))


def trembles(values: Vector, rate_hz: float) -> bool:
    """Whether what made `values` (n, 3) was moved: noise alone is as dense below as above."""
    return bool((density(values, rate_hz, LOW_HZ) > TREMBLES * density(values, rate_hz)).any())
