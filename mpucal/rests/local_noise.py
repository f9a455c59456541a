"""The accelerometer's noise as it is around each sample: a motor that starts makes it louder than it was at rest.

Fourth differences leave noise and vibration, and next to nothing of a hand below 10 Hz at 100 samples a second or more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..data import Recording, Vector
from ..kernel import _kernel

if TYPE_CHECKING:
    from .flat import Flat

WINDOW_S = 0.5
ORDER, SQUARES = 4, 70.0  # of the differences: sum of the squares of 1, -4, 6, -4, 1
# variances: below this a window is as loud as the flat segment, but for chance and a hand
LOUDER = 2.0


def noise_variance(recording: Recording) -> Vector:
    """(n, 3) (m/s^2)^2, as if white, in a window of half a second around each sample."""
    acc, n = recording.acc, len(recording)
    squares = np.zeros((n, 3))
    if n > ORDER:
        squares[ORDER // 2 : -ORDER // 2] = np.square(np.diff(acc, ORDER, axis=0)) / SQUARES
    return _kernel.moving_mean(squares, max(round(WINDOW_S * recording.rate_hz) // 2, 2))


def noise_ratio(recording: Recording, flat: Flat) -> Vector:
    """(n,) the noise around each sample, as a factor of Sigma_a; 1 where it is as at rest."""
    ratio = noise_variance(recording) @ (1.0 / (3.0 * flat.Sigma_a))
    return np.asarray(np.where(ratio > LOUDER, ratio, 1.0))
