"""Result of a fit, for all models: parameters, covariance, and how the search ended."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..data import Vector
from .parameters import D_NAMES
from .parts import Parts
from .slip import Slip


@dataclass(frozen=True)
class Fit:
    """Estimated parameters of any model.

    Attributes
    ----------
    D : (3, 3). b_a : (3,) m/s^2. b_omega : (3,) rad/s. K : (3, 3).
    names : names of the p estimated parameters, D row-major first, then b_a.
    covariance : (p, p), in the order of `names`.
    iterations : of the minimiser. converged : True if it met its stopping rule.
    nis : mean of ||e_t||^2 weighted by the inverse of S_t, over all samples; 3 where the model holds.
    V : the cost function (8) at the estimate.
    at_prior : names of parameters that the data hardly determine: they keep what was known beforehand.
    parts : scores of the parts of the recording at the estimate; None where they are not known.
    delay_s : delay of the accelerometer behind the gyroscope; 0 where the model does not estimate it.
    spread_mps2 : error of a rest's |a| beside noise and tremor, of an estimate from the rests alone.
    freedom : degrees of freedom that this estimate leaves.
    slip : slip of the mount that the rests show, or None.
    slipped : (12,) variances of D and b_a by slips that may have happened near the ends.
    """

    D: Vector
    b_a: Vector
    b_omega: Vector
    K: Vector
    names: tuple[str, ...]
    covariance: Vector
    iterations: int
    converged: bool
    nis: float
    V: float
    at_prior: tuple[str, ...] = ()
    parts: Parts | None = None
    delay_s: float = 0.0
    spread_mps2: float = 0.0
    freedom: float = 0.0
    slip: Slip | None = None
    slipped: Vector | None = None

    def std(self, *names: str) -> Vector:
        """Return standard deviations of the named parameters, NaN for those that were not estimated."""
        variance = dict(zip(self.names, np.diag(self.covariance), strict=True))
        return np.sqrt([max(variance.get(name, np.nan), 0.0) for name in names])

    def right_handed(self) -> Fit:
        """Return the one with det D > 0 of (D, u) and (-D, -u), which fit equally well."""
        if not np.linalg.det(self.D) < 0.0:
            return self
        sign = np.array([-1.0 if name in D_NAMES else 1.0 for name in self.names])
        return replace(self, D=-self.D, covariance=self.covariance * np.outer(sign, sign))
