"""The second-order low pass that ArduPilot puts on its IMUs."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter

from ...data import Vector


class LowPass:
    """Butterworth filters of order 2, one for each row of a value's last axis but one.

    Parameters
    ----------
    cutoffs_hz : (k,) for values (..., k, 3); 0 passes everything.
    """

    def __init__(self, cutoffs_hz: tuple[float, ...], rate_hz: float) -> None:
        passes = ([1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
        made = [butter(2, cutoff, fs=rate_hz) if cutoff > 0 else passes for cutoff in cutoffs_hz]
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
