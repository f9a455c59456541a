"""Parts of a series, with their scores at the estimate.

Where the model holds, the parts differ by chance. Where it does not (drift, a nonlinear sensor, vibration), only the
parts show it, and not the covariance of the estimate: see hypotheses.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..data import Vector
from .normal_equations import inverse
from .rotation import sides_down


@dataclass(frozen=True)
class Parts:
    """Scores of k parts of about equal length, at the estimate.

    Attributes
    ----------
    gradient : (k, p) and fisher : (k, p, p), the share of each part in those of V, by the estimated parameters.
    H : (p, p) Fisher matrix of all parts, the prior and the flat mean. left : (p,) gradient of them, which a minimiser
        leaves at nearly 0.
    start, end : (k,) s after the flat segment.
    reading : (1 + k, 3) m/s^2, mean readings without b_a, of the flat segment and of the parts.
    """

    gradient: Vector
    fisher: Vector
    H: Vector
    left: Vector
    start: Vector
    end: Vector
    reading: Vector

    def __len__(self) -> int:
        return len(self.start)

    @cached_property
    def is_finite(self) -> bool:
        """True if the Fisher matrix is finite, as it is not of an accelerometer that reads zeros."""
        return bool(np.isfinite(self.H).all())

    @cached_property
    def side(self) -> NDArray[np.intp]:
        """Side (k,) that was down, 0 to 5: the accelerometer's axis nearest to gravity, with its sign."""
        return sides_down(self.reading[1:])

    @cached_property
    def covariance(self) -> Vector:
        """Covariance (p, p) of the estimate, by the model."""
        return inverse(self.H)

    def grouped(self, first: NDArray[np.intp]) -> tuple[Vector, Vector]:
        """Return gradients (m, p) and Fisher matrices (m, p, p) of groups that begin with the parts `first` (m,)."""
        gradient, fisher, size = self.gradient[first], self.fisher[first], np.diff(first, append=len(self))
        for k in range(1, size.max()):  # a fifth of the time of NumPy's reduceat
            more = size > k
            gradient[more] += self.gradient[first[more] + k]
            fisher[more] += self.fisher[first[more] + k]
        return gradient, fisher

    def by_time(self, groups: int) -> NDArray[np.intp]:
        """Return (k,) the group of each part, in `groups` stretches of time, or as many as there are parts."""
        return np.arange(len(self)) * min(groups, len(self)) // len(self)
