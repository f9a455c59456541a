"""The second-order low pass that ArduPilot puts on its IMUs. Knows no sensor."""

from __future__ import annotations

import math

import numpy as np

from ...data import Vector


class LowPass:
    """A Butterworth filter of order 2 by the bilinear transform, on an array of any shape.

    Parameters
    ----------
    cutoff_hz : 0 passes everything.
    """

    def __init__(self, cutoff_hz: float, rate_hz: float) -> None:
        self._past: tuple[Vector, Vector] | None = None
        self._passes = cutoff_hz <= 0
        if self._passes:
            return
        ohm = math.tan(math.pi * cutoff_hz / rate_hz)
        c = 1 + 2 * math.cos(math.pi / 4) * ohm + ohm * ohm
        self._b = ohm * ohm / c
        self._a = (2 * (ohm * ohm - 1) / c, (1 - 2 * math.cos(math.pi / 4) * ohm + ohm * ohm) / c)

    def __call__(self, value: Vector) -> Vector:
        """The filtered `value`; the first one has been there for ever."""
        if self._passes:
            return value
        if self._past is None:
            at_rest = value / (1 + self._a[0] + self._a[1])
            self._past = (at_rest, at_rest)
        one, two = self._past
        new = value - self._a[0] * one - self._a[1] * two
        self._past = (new, one)
        return np.asarray(self._b * (new + 2 * one + two))
