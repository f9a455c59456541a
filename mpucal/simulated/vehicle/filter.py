"""Second-order low pass of ArduPilot's IMUs."""

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
    cutoffs_hz : (k,) for values (..., k, 3); 0: no filter. most : number of values that come at once.
    """

    def __init__(self, cutoffs_hz: tuple[float, ...], rate_hz: float, most: int) -> None:
        made = [butterworth(cutoff, rate_hz) if cutoff > 0 else (PASSES, PASSES) for cutoff in cutoffs_hz]
        # Each is (3, k, 1).
        self._b, self._a = np.array(made).transpose(1, 2, 0)[..., None]
        # Response (most + 1, k) of all following values to one value.
        left = [np.ones(len(made)), -self._a[1, :, 0]]
        while len(left) <= most:
            left.append(-self._a[1, :, 0] * left[-1] - self._a[2, :, 0] * left[-2])
        response = np.array(left)
        since = np.subtract.outer(np.arange(most), np.arange(most))
        self._of_values = np.where(since[..., None] >= 0, response[since], 0.0)
        self._of_past = np.stack((-self._a[2, :, 0] * response[:-1], response[1:]), axis=1)
        self._states: Vector | None = None

    def __call__(self, values: Vector, again: int = 0) -> Vector:
        """Return the filtered `values` (n, ..., k, 3); the filter starts in the steady state of the first one.

        Parameters
        ----------
        again : number of the last values that come once more, with others in their places.
        """
        n = len(values)
        if self._states is None:
            self._states, again = np.repeat(values[:1] / self._a.sum(0), 2, axis=0), 0
        past = self._states[len(self._states) - again - 2 :][:2]
        new = np.einsum("ijk,j...kc->i...kc", self._of_values[:n, :n], values)
        new += np.einsum("ipk,p...kc->i...kc", self._of_past[:n], past)
        states = self._states = np.concatenate((past, new))
        return np.asarray(self._b[0] * states[2:] + self._b[1] * states[1:-1] + self._b[2] * states[:-2])


def butterworth(cutoff_hz: float, rate_hz: float) -> tuple[Three, Three]:
    """Return numerator and denominator as ArduPilot computes them (DigitalBiquadFilter).

    This is the bilinear transform of 1 / (s^2 + sqrt(2) s + 1) with a warped frequency; scipy.signal, which has it,
    takes a second to load.
    """
    w = math.tan(math.pi * cutoff_hz / rate_hz)
    whole = 1.0 + math.sqrt(2.0) * w + w * w
    share = w * w / whole
    return (share, 2.0 * share, share), (1.0, 2.0 * (w * w - 1.0) / whole, (1.0 - math.sqrt(2.0) * w + w * w) / whole)
