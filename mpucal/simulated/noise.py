"""Noise of known coefficients, as a sensor at rest makes it."""

from __future__ import annotations

import numpy as np

from ..data import Vector


def noise(rng: np.random.Generator, n: int, rate_hz: float, white: float, instability: float, walk: float) -> Vector:
    """(n,) samples of white noise [units/sqrt(Hz), two-sided], bias instability [units], random walk [units/sqrt(s)].

    The slow two are drawn in the frequency domain, over twice the time so that their ends do not meet, by the densities
    of IEEE Std 952, annex C.
    """
    f = np.fft.rfftfreq(2 * n)[1:]
    density = instability**2 / (2.0 * np.pi * f) + walk**2 / rate_hz / (4.0 * np.sin(np.pi * f) ** 2)
    drawn = rng.standard_normal((2, len(f))) * np.sqrt(density * n)
    slow = np.fft.irfft(np.concatenate([[0.0], drawn[0] + 1j * drawn[1]]), 2 * n)[:n]
    return np.asarray(slow + white * np.sqrt(rate_hz) * rng.standard_normal(n))
