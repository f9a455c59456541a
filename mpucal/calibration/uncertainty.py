"""Uncertainty of a calibrated measurement: predicted by a covariance, and claimed where parts of a recording disagree.

The claim is the larger of two errors, the model's own and the jackknife's. Where the sensor changed midway, each
element's standard deviation also holds what the element was and what it became.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ..data import Vector
from .changes import SIGNIFICANT, Change, walked_covariance
from .fit import Fit
from .jackknife import TINY_MPS2, Jackknife, jackknife
from .parameters import ACCELEROMETER
from .rotation import fibonacci_sphere

DIRECTIONS = 400
LEAST_DETERMINANT = 1e-6  # a D of less is singular
# Nothing is known better than this where a walk was removed, since it is interpolated linearly from part to part.
FLOOR_MPS2 = 5e-5
MOST_NIS = 5.0  # NIS of a model that explains the data; 3 is expected
# The model's uncertainty is multiplied by this where too few sides were down for a comparison of them.
UNCOMPARED = 2.0
# A change of more than so many times the jackknife's error is none: changes reach 10, turns with a pull 35 to 750.
MOST_UNFELT = 20.0


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of a calibrated measurement over all directions of gravity.

    Attributes
    ----------
    rms_mps2 : of the vector. magnitude_mps2, direction_rad : of its length and angle.
    worst : (3,) unit, the least known direction in the body frame.
    """

    rms_mps2: float
    magnitude_mps2: float
    direction_rad: float
    worst: Vector


def propagate(D: Vector, covariance: Vector, gravity: float, unit: Vector | None = None) -> Uncertainty:
    """Propagate the (12, 12) covariance of (D row-major, b_a) to s = inv(D) (y - b_a) with |s| = gravity.

    unit : (n, 3) directions of s; None: all over the sphere.
    """
    unit = fibonacci_sphere(DIRECTIONS) if unit is None else unit
    # The error is -inv(D) (dD s + db): linear in the twelve parameters, and in (s, 1).
    s = np.column_stack([gravity * unit, np.ones(len(unit))])
    J = np.zeros((4, 3, 12))
    for i in range(3):
        J[[0, 1, 2, 3], i, [3 * i, 3 * i + 1, 3 * i + 2, 9 + i]] = 1.0
    errors = (np.linalg.inv(D) @ J).reshape(12, 12)
    by_products = (errors @ covariance @ errors.T).reshape(4, 3, 4, 3).swapaxes(1, 2).reshape(16, 9)
    C = ((s[:, :, None] * s[:, None, :]).reshape(-1, 16) @ by_products).reshape(-1, 3, 3)
    total = np.maximum(np.einsum("nii->n", C), 0.0)
    along = np.maximum(np.einsum("ni,nij,nj->n", unit, C, unit), 0.0)
    return Uncertainty(
        rms_mps2=float(np.sqrt(total.mean())),
        magnitude_mps2=float(np.sqrt(along.mean())),
        direction_rad=float(np.sqrt(np.maximum(total - along, 0.0).mean()) / gravity),
        worst=unit[int(np.argmax(total))],
    )


@dataclass(frozen=True)
class UncertaintyClaim:
    """Claimed error of a calibration, rms over all directions, and the estimates that it is the largest of.

    Attributes
    ----------
    model : m/s^2, by the covariance of the model.
    floored : m/s^2, `model` enlarged by what is left of a walk of the gyroscope's bias that was removed, and where too
        few sides were down for a comparison of them.
    left_out : errors by leaving parts out.
    change : change of the sensor while the board was turned; None where it stayed the same. change_error : m/s^2.
    """

    model: float
    floored: float
    left_out: Jackknife
    change: Change | None = None
    change_error: float = 0.0

    @property
    def inflation(self) -> float:
        """Claimed uncertainty as a multiple of the model's, 1 or more."""
        return max(self.floored, self.left_out.claim(), self.change_error) / self.model

    @property
    def decided_by(self) -> Literal["model", "time", "side", "change"]:
        """Estimate that set the claimed uncertainty."""
        if max(self.left_out.claim(), self.change_error) <= self.floored:
            return "model"
        return "change" if self.change_error > self.left_out.claim() else self.left_out.decided_by()

    def widen(self, covariance: Vector) -> Vector:
        """Return a covariance (p, p) of the model as it is claimed: it holds what a changed sensor was and became."""
        same = (max(self.floored, self.left_out.claim()) / self.model) ** 2 * covariance
        return same if self.change is None else same + np.diag(self.change.away**2)


def claim_uncertainty(fit: Fit, gravity: float, change: Change | None, walked: float) -> UncertaintyClaim | None:
    """Return the claimed uncertainty of a fit; None where its parts are not known, or D or the covariance is unusable.

    change : the most likely change that the fit's parts show. walked : (rad/s)^2 from part to part, of a walk of the
        gyroscope's bias that was removed.
    """
    if fit.parts is None or not is_usable(fit):
        return None
    rms = partial(_rms, fit.D, gravity=gravity)
    model = floored = rms(fit.covariance)
    if walked:
        wider = max(1.0, rms(walked_covariance(fit.parts, fit.D, walked)) / rms(fit.parts.covariance))
        floored = float(np.hypot(wider * model, FLOOR_MPS2))
    left_out = jackknife(fit.parts, fit.D, gravity)
    if not left_out.side:
        floored *= UNCOMPARED
    same = UncertaintyClaim(model, floored, left_out)
    if change is None or not fit.converged:
        return same
    # A model that does not explain its innovations leaves the hand's motion in every part, which looks like a walk.
    if (change.alone if fit.nis <= MOST_NIS else change.gain) < SIGNIFICANT:
        return same
    error = rms(np.diag(change.away**2))
    # A sensor that changed moves the estimate when parts are left out; a steady pull on a moving hand does not.
    return (
        same if error > MOST_UNFELT * max(left_out.claim(), model) else replace(same, change=change, change_error=error)
    )


def is_usable(fit: Fit) -> bool:
    """Return True if D is finite and regular, and the covariance finite."""
    if not (np.isfinite(fit.covariance).all() and np.isfinite(fit.D).all()):
        return False
    return not abs(np.linalg.det(fit.D)) < LEAST_DETERMINANT


def inflate(fit: Fit, claim: UncertaintyClaim | None) -> Fit:
    """Return the fit with the claimed covariance."""
    return fit if claim is None else replace(fit, covariance=claim.widen(fit.covariance))


def _rms(D: Vector, covariance: Vector, gravity: float) -> float:
    return max(propagate(D, covariance[ACCELEROMETER, ACCELEROMETER], gravity).rms_mps2, TINY_MPS2)
