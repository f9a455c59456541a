"""What an estimate claims of its error: the larger of what the model says and what leaving parts out says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from .fit import Fit
from .jackknife import Jackknife, jackknife
from .levenberg_marquardt import inverse
from .parameters import ACCELEROMETER
from .uncertainty import uncertainty
from .walks import SIGNIFICANT, Walk, likeliest_walk

SINGULAR, TINY_MPS2 = 1e-6, 1e-9
MOST_LOUDER = 3.0  # a change makes its parts differ as well


@dataclass(frozen=True)
class Claim:
    """Where the standard deviations come from.

    Attributes
    ----------
    model : m/s^2, rms over all directions, by the covariance of the model. left_out : by leaving parts out.
    change : of the sensor while the board was turned; None where it stayed the same. of_change : m/s^2, its error.
    """

    model: float
    left_out: Jackknife
    change: Walk | None
    of_change: float = 0.0

    @property
    def inflation(self) -> float:
        """By how much the model's standard deviations are too small, 1 or more."""
        return max(1.0, self.left_out.claim() / self.model, self.of_change / self.model)

    @property
    def by(self) -> Literal["model", "time", "side", "change"]:
        """What decided."""
        if self.inflation == 1.0:
            return "model"
        return "change" if self.of_change > self.left_out.claim() else self.left_out.decides()


def claim_of(fit: Fit, gravity: float) -> Claim | None:
    """Of a fit by the filter; None for one whose parts are not known, or that has no usable D or covariance."""
    if fit.parts is None or not np.isfinite(fit.covariance).all() or abs(np.linalg.det(fit.D)) < SINGULAR:
        return None
    covariance = fit.covariance[ACCELEROMETER, ACCELEROMETER]
    model = max(uncertainty(fit.D, covariance, gravity).rms_mps2, TINY_MPS2)
    left_out, change = jackknife(fit.parts, fit.D, gravity), likeliest_walk(fit.parts, fit.D)
    # where parts that stayed the same differ by more than their scores' noise, a change must stand out the more
    scores = uncertainty(fit.D, inverse(fit.parts.H)[ACCELEROMETER, ACCELEROMETER], gravity).rms_mps2
    louder = float(np.fmin(max(left_out.claim(), model) / max(scores, TINY_MPS2), MOST_LOUDER))
    if change is None or not fit.converged or change.gain < SIGNIFICANT * louder**2:
        return Claim(model, left_out, None)
    return Claim(model, left_out, change, change.error(gravity))


def claimed(fit: Fit, claim: Claim | None) -> Fit:
    """The fit with the covariance that is claimed."""
    if claim is None:
        return fit
    return replace(fit, covariance=claim.inflation**2 * fit.covariance)
