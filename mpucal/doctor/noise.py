"""Noise density of a sensor at rest."""

from __future__ import annotations

import numpy as np

from ..data import Vector

# Both bands lie above slow drift and below a low-pass filter of 44 Hz; a hand trembles in the lower one only.
LOW_HZ, HIGH_HZ = (1.0, 12.0), (20.0, 40.0)
TREMBLES = 2.0


def noise_density(values: Vector, rate_hz: float, band_hz: tuple[float, float] = HIGH_HZ) -> Vector:
    """Return (3,) unit/sqrt(Hz): the root of the mean one-sided spectrum of `values` (n, 3) within `band_hz`."""
    hz, power = periodogram(values, rate_hz)
    inside = (band_hz[0] <= hz) & (hz <= band_hz[1])
    return np.asarray(np.sqrt(power[inside].mean(0)))


def periodogram(values: Vector, rate_hz: float) -> tuple[Vector, Vector]:
    """Return frequencies (m,) [Hz] and the one-sided power spectral density (m, 3) [unit^2/Hz] of `values` (n, 3).

    The mean is removed, and a Hann window applied, as by scipy.signal.periodogram, which takes a second to load.
    """
    n = len(values)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)
    power = np.abs(np.fft.rfft(window[:, None] * (values - values.mean(0)), axis=0)) ** 2
    # Add the power of negative frequencies; zero and half the rate have none.
    power[1 : (n + 1) // 2] *= 2.0
    return np.asarray(np.fft.rfftfreq(n, 1.0 / rate_hz), np.float64), power / (rate_hz * (window @ window))


def is_trembling(values: Vector, rate_hz: float) -> bool:
    """Return True if the board was moved: the noise alone is as dense in the lower band as in the higher."""
    return bool((noise_density(values, rate_hz, LOW_HZ) > TREMBLES * noise_density(values, rate_hz)).any())
