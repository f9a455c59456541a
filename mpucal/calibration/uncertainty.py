"""Uncertainty of a calibrated measurement: predicted by a covariance, and claimed where parts of a recording disagree.

The claim is the model's own covariance, and by how much each element may be off by what happened besides
(hypotheses.py). Where the sensor changed midway, it holds what the element was and what it became.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ..data import Vector
from ..result.blob import is_invertible
from .fit import Fit
from .hypotheses import Explanation, Kind, nonlinearity
from .parameters import ACCELEROMETER
from .rotation import fibonacci_sphere

# Nothing is known better than this where a change of the gyroscope's bias was removed: it is interpolated linearly.
FLOOR_MPS2 = 5e-5
MOST_NIS = 5.0  # NIS of a model that explains the data; 3 is expected
# The model's uncertainty is multiplied by this where so few sides were down that they hardly show what it lacks.
UNCOMPARED = 2.0
FEWEST_SIDES = 4


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
    unit = fibonacci_sphere() if unit is None else unit
    s, errors = np.column_stack([gravity * unit, np.ones(len(unit))]), _errors_of(D)
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


def _errors_of(D: Vector) -> Vector:
    """Return (12, 12), -inv(D) (dD s + db) of each parameter (in columns), for each element of (s, 1) in three rows."""
    J = np.zeros((4, 3, 12))
    for i in range(3):
        J[[0, 1, 2, 3], i, [3 * i, 3 * i + 1, 3 * i + 2, 9 + i]] = 1.0
    return np.asarray((np.linalg.inv(D) @ J).reshape(12, 12))


@dataclass(frozen=True)
class UncertaintyClaim:
    """Claimed uncertainty of a calibration, and what it is made of.

    Attributes
    ----------
    covariance : (p, p) of the model, a nonlinearity and what is unknown of changes of the gyroscope's bias that were
        removed. model : m/s^2, the error by it, rms over all directions.
    floored : m/s^2, `model` enlarged where changes were removed, and where few sides were down.
    explanations : what may have happened besides, the likeliest first. errors : (n,) m/s^2, what each adds.
    slipped : (12,) variances of D and b_a by slips of the mount near the ends, which no explanation holds.
    """

    covariance: Vector
    model: float
    floored: float
    explanations: Sequence[Explanation] = ()
    errors: Sequence[float] = ()
    slipped: Vector | None = None

    @property
    def worst(self) -> Explanation | None:
        """Explanation that adds most to the uncertainty; None where all of them add less than the model has."""
        most = max(self.errors, default=0.0)
        return self.explanations[list(self.errors).index(most)] if most > self.floored else None

    @property
    def decided_by(self) -> Kind | Literal["model"]:
        """Kind of what sets the claimed uncertainty."""
        return "model" if self.worst is None else self.worst.hypothesis.kind

    @property
    def change(self) -> Explanation | None:
        """Change of the accelerometer that surely happened, or None."""
        return next((each for each in self.explanations if each.is_sure), None)

    def error(self, kind: Kind) -> float:
        """Return the largest error [m/s^2] that an explanation of a kind adds."""
        of = [error for each, error in zip(self.explanations, self.errors, strict=True) if each.hypothesis.kind == kind]
        return max(of, default=0.0)

    def widen(self) -> Vector:
        """Return the covariance (p, p) as it is claimed.

        It holds the mean of the explanations by their weights, and of what surely happened each that may be its cause:
        the true cause need not be in the table, and may be like any of them.
        """
        wide = (self.floored / self.model) ** 2 * self.covariance
        squares = np.reshape([each.away for each in self.explanations], (-1, len(wide))) ** 2
        mean = np.array([each.weight for each in self.explanations]) @ squares
        held = squares[[each.is_possible for each in self.explanations]].max(axis=0, initial=0.0)
        if self.slipped is not None:
            held[ACCELEROMETER] = np.maximum(held[ACCELEROMETER], self.slipped)
        return np.asarray(wide + np.diag(np.maximum(mean, held)))


def claim_uncertainty(
    fit: Fit, gravity: float, explanations: Sequence[Explanation], removed: Vector | float = 0.0
) -> UncertaintyClaim | None:
    """Return the claimed uncertainty of a fit; None where its parts are not known, or D or the covariance is unusable.

    explanations : of the fit's parts. removed : (p, p) covariance by removed changes of the gyroscope's bias.
    """
    if fit.parts is None or not is_usable(fit):
        return None
    # over the sphere, the square of each element of s is gravity^2 / 3 in the mean, and their products are 0
    rms = partial(_rms, np.repeat([gravity / 3.0**0.5, 1.0], [9, 3])[:, None] * _errors_of(fit.D))
    covariance = fit.covariance + removed + nonlinearity(fit.parts, fit.D)  # no sensor is perfectly linear
    model = floored = rms(covariance)
    if np.any(removed):
        floored = float(np.hypot(model, FLOOR_MPS2))
    if len(np.unique(fit.parts.side)) < FEWEST_SIDES:
        floored *= UNCOMPARED
    errors = [each.weight**0.5 * rms(np.diag(each.away**2)) for each in explanations]
    return UncertaintyClaim(covariance, model, floored, explanations, errors, fit.slipped)


def is_usable(fit: Fit) -> bool:
    """Return True if D is finite and regular, and the covariance finite."""
    return bool(np.isfinite(fit.covariance).all()) and is_invertible(fit.D.ravel().tolist())


def inflate(fit: Fit, claim: UncertaintyClaim | None) -> Fit:
    """Return the fit with the claimed covariance."""
    return fit if claim is None else replace(fit, covariance=claim.widen())


def _rms(errors: Vector, covariance: Vector) -> float:
    """Return the error [m/s^2] over all directions by a covariance (p, p) and the errors (12, 12) of a unit each."""
    squares = np.sum((errors @ covariance[ACCELEROMETER, ACCELEROMETER]) * errors)
    return float(np.sqrt(max(squares, np.finfo(np.float64).tiny)))
