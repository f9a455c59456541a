"""What an estimate claims of its error: the larger of what the model says and what leaving parts out says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ..data import Vector
from .bias_walks import SIGNIFICANT, BiasWalk, walked_covariance
from .fit import Fit
from .jackknife import Jackknife, jackknife
from .parameters import ACCELEROMETER
from .uncertainty import uncertainty

SINGULAR, TINY_MPS2 = 1e-6, 1e-9
FLOOR_MPS2 = 5e-5  # nothing is known better where a walk was taken away, drawn straight from part to part
MOST_NIS = 5.0  # of innovations that the model explains; 3 is expected
UNCOMPARED = 2.0  # times the model's claim, where too few sides were down to be compared
MOST_UNFELT = 20.0  # times what leaving parts out says: changes reach 10, turns with a steady pull 35 to 750


@dataclass(frozen=True)
class Claim:
    """Where the standard deviations come from.

    Attributes
    ----------
    model : m/s^2, rms over all directions, by the covariance of the model. floored : the same, but with what is left of
        a walk of the gyroscope's bias where one was taken away, and for what too few sides cannot contradict.
    left_out : by leaving parts out. change : of the sensor while the board was turned; None where it stayed the same.
    of_change : m/s^2, its error.
    """

    model: float
    floored: float
    left_out: Jackknife
    change: BiasWalk | None
    of_change: float = 0.0

    @property
    def inflation(self) -> float:
        """By how much the model's standard deviations are too small, 1 or more."""
        return max(self.floored, self.left_out.claim(), self.of_change) / self.model

    @property
    def by(self) -> Literal["model", "time", "side", "change"]:
        """What decided."""
        if max(self.left_out.claim(), self.of_change) <= self.floored:
            return "model"
        return "change" if self.of_change > self.left_out.claim() else self.left_out.decides()


def claim_of(fit: Fit, gravity: float, change: BiasWalk | None, walked: float) -> Claim | None:
    """Of a fit by the filter; None for one whose parts are not known, or that has no usable D or covariance.

    change : the likeliest walk that the fit's parts show. walked : (rad/s)^2 from part to part, of a walk of the
        gyroscope's bias that was taken away.
    """
    if fit.parts is None or not np.isfinite(fit.covariance).all() or abs(np.linalg.det(fit.D)) < SINGULAR:
        return None
    rms = partial(_rms, fit.D, gravity=gravity)
    model = floored = rms(fit.covariance)
    if walked:
        wider = max(1.0, rms(walked_covariance(fit.parts, fit.D, walked)) / rms(fit.parts.covariance))
        floored = float(np.hypot(wider * model, FLOOR_MPS2))
    left_out = jackknife(fit.parts, fit.D, gravity)
    if not left_out.side:
        floored *= UNCOMPARED
    # a model that does not explain its innovations leaves the hand's motion in every part, and is off by that
    if change is None or not fit.converged or (change.alone if fit.nis <= MOST_NIS else change.gain) < SIGNIFICANT:
        return Claim(model, floored, left_out, None)
    # a sensor that changed pulls the estimate along; a hand that was pulled aside while it moved does not
    if change.error(gravity) > MOST_UNFELT * max(left_out.claim(), model):
        return Claim(model, floored, left_out, None)
    return Claim(model, floored, left_out, change, change.error(gravity))


def _rms(D: Vector, covariance: Vector, gravity: float) -> float:
    return max(uncertainty(D, covariance[ACCELEROMETER, ACCELEROMETER], gravity).rms_mps2, TINY_MPS2)


def claimed(fit: Fit, claim: Claim | None) -> Fit:
    """The fit with the covariance that is claimed."""
    if claim is None:
        return fit
    return replace(fit, covariance=claim.inflation**2 * fit.covariance)
