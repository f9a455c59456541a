"""The second-order low pass that ArduPilot puts on its IMUs. Knows no sensor."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...data import Vector


class LowPass:
    """A Butterworth filter of order 2 by the bilinear transform, on an array of any shape.

    Parameters
    ----------
    cutoff_hz : broadcast against the array; 0 passes everything.
    """

    def __init__(self, cutoff_hz: ArrayLike, rate_hz: float) -> None:
        cutoff = np.asarray(cutoff_hz, float)
        self._passes = cutoff <= 0
        ohm = np.tan(np.pi * np.where(self._passes, 1.0, cutoff) / rate_hz)
        c = 1 + np.sqrt(2) * ohm + ohm * ohm
        self._b = ohm * ohm / c
        self._a = (2 * (ohm * ohm - 1) / c, (1 - np.sqrt(2) * ohm + ohm * ohm) / c)
        self._past: tuple[Vector, Vector] | None = None

    def __call__(self, value: Vector) -> Vector:
        """The filtered `value`; the first one has been there for ever."""
        if self._past is None:
            at_rest = value / (1 + self._a[0] + self._a[1])
            self._past = (at_rest, at_rest)
        one, two = self._past
        new = value - self._a[0] * one - self._a[1] * two
        self._past = (new, one)
        return np.where(self._passes, value, self._b * (new + 2 * one + two))
