"""The second-order low pass that ArduPilot puts on its IMUs."""

from __future__ import annotations

import math

import numpy as np

from ...data import Vector

Three = tuple[float, float, float]
PASSES: Three = (1.0, 0.0, 0.0)


class LowPass:
    """Butterworth filters of order 2, one for each row of a value's last axis but one.

    Parameters
    ----------
    cutoffs_hz : (k,) for values (..., k, 3); 0 passes everything.
    """

    def __init__(self, cutoffs_hz: tuple[float, ...], rate_hz: float) -> None:
        made = [butterworth(cutoff, rate_hz) if cutoff > 0 else (PASSES, PASSES) for cutoff in cutoffs_hz]
        # (3, k, 1) each
        self._b, self._a = np.array(made).transpose(1, 2, 0)[..., None]
        self._past: tuple[Vector, Vector] | None = None

    def __call__(self, value: Vector) -> Vector:
        """The filtered `value`; the first one has been there for ever."""
        if self._past is None:
            self._past = (value / self._a.sum(0),) * 2
        one, two = self._past
        new = value - self._a[1] * one - self._a[2] * two
        self._past = (new, one)
        return np.asarray(self._b[0] * new + self._b[1] * one + self._b[2] * two)


def butterworth(cutoff_hz: float, rate_hz: float) -> tuple[Three, Three]:
    """Numerator and denominator, as ArduPilot computes them (DigitalBiquadFilter); scipy.signal takes a second to load.

    The bilinear transform of 1 / (s^2 + sqrt(2) s + 1), its frequency warped.
    """
    w = math.tan(math.pi * cutoff_hz / rate_hz)
    whole = 1.0 + math.sqrt(2.0) * w + w * w
    share = w * w / whole
    return (share, 2.0 * share, share), (1.0, 2.0 * (w * w - 1.0) / whole, (1.0 - math.sqrt(2.0) * w + w * w) / whole)
