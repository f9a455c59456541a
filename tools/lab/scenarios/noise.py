"""Noise of a sensor at rest, with known coefficients."""

import numpy as np

from mpucal.data import Vector


def noise(rng: np.random.Generator, n: int, rate_hz: float, white: float, instability: float, walk: float) -> Vector:
    """Return (n,) samples of white noise, bias instability and random walk.

    Bias instability is drawn in the frequency domain, by the density of IEEE Std 952, annex C, over twice the time so
    that its ends do not meet. The random walk is a cumulative sum of white noise.

    Parameters
    ----------
    white : units/sqrt(Hz), two-sided. instability : units. walk : units/sqrt(s).
    """
    f = np.fft.rfftfreq(2 * n)[1:]
    drawn = rng.standard_normal((2, len(f))) * instability * np.sqrt(n / (2.0 * np.pi * f))
    flicker = np.fft.irfft(np.concatenate([[0.0], drawn[0] + 1j * drawn[1]]), 2 * n)[:n]
    steps = walk / np.sqrt(rate_hz) * rng.standard_normal(n)
    return np.asarray(flicker + np.cumsum(steps) + white * np.sqrt(rate_hz) * rng.standard_normal(n))
