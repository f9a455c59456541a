"""Points in the space of all parameters, the steps between them, and prior densities over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..data import Sensor, Vector
from ..rests.flat import Flat
from ..rests.gyro_drift import SENSITIVITY_SD
from ..result.correlation import UPPER
from .parameters import BY_NAME, HAND, NAMES, PLACES, SENSITIVE, TABLE, Form, Parameter, estimated
from .rotation import tangents

EXACT = estimated("imu")  # parameters of the exact filter


@dataclass(frozen=True)
class Theta:
    """Values of all parameters of the model, one field for each row of the table; those not estimated keep their start.

    Attributes
    ----------
    D : (3, 3). b_a : (3,) m/s^2. b_omega : (3,) rad/s. K : (3, 3) symmetric.
    tau : s, by which the accelerometer lags behind the gyroscope. r : (3,) m, the lever arm.
    u : (3,) unit, gravity's direction in the body frame at the start (two parameters: tilts about it).
    """

    D: Vector
    b_a: Vector
    b_omega: Vector
    u: Vector
    K: Vector
    tau: float
    r: Vector

    @classmethod
    def start(cls, D: Vector, b_a: Vector, b_omega: Vector, u: Vector) -> Theta:
        """Return theta with the given values, and the table's starting values: a perfect gyroscope and no hand."""
        values = {row.field: from_elements(row.form, np.array(row.mean)) for row in TABLE if row.field != "u"}
        return cls(**{**values, "D": D, "b_a": b_a, "b_omega": b_omega, "u": u})

    def moved(self, delta: Vector) -> Theta:
        """Return theta + delta, delta (p,) in the order of NAMES; the tilts turn u and keep it a unit vector."""
        d = np.zeros(len(NAMES))
        d[: len(delta)] = delta
        moved = {row.field: _moved(row.form, getattr(self, row.field), d[PLACES[row.name]]) for row in TABLE}
        return replace(self, **moved)

    def right_handed(self) -> Theta:
        """Return the one with det D > 0 of (D, u) and (-D, -u), which fit equally well."""
        return self if np.linalg.det(self.D) > 0.0 else replace(self, D=-self.D, u=-self.u)

    @cached_property
    def inverse(self) -> Vector:
        """Inverse of D, or its pseudoinverse: a search may pass through a singular D, and must not stop there."""
        try:
            return np.asarray(np.linalg.inv(self.D))
        except np.linalg.LinAlgError:
            return np.asarray(np.linalg.pinv(self.D))

    @cached_property
    def packed(self) -> Vector:
        """The hand's filter's structure: matrices whole, u with its derivatives by the tilts."""
        return self._packed(TABLE)

    @cached_property
    def packed_exact(self) -> Vector:
        """The exact filter's structure, see packed."""
        return self._packed(EXACT)

    def _packed(self, rows: Sequence[Parameter]) -> Vector:
        return np.concatenate([_packed(row.form, getattr(self, row.field)) for row in rows])

    def values(self) -> Vector:
        """Return the parameters (p,) in the order of NAMES; the tilts are zero by definition."""
        return np.concatenate([_elements(row.form, getattr(self, row.field)) for row in TABLE])


def from_elements(form: Form, elements: Vector) -> Any:
    """Return the matrix, vector or number that has these parameters."""
    if form is Form.MATRIX:
        return elements.reshape(3, 3)
    if form is Form.SYMMETRIC:
        xx, xy, xz, yy, yz, zz = elements.tolist()
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(elements[0]) if form is Form.SCALAR else elements


def _elements(form: Form, value: Any) -> Vector:
    if form is Form.DIRECTION:
        return np.zeros(2)
    return np.asarray(value[UPPER] if form is Form.SYMMETRIC else np.ravel(value))


def _moved(form: Form, value: Any, d: Vector) -> Any:
    if form is Form.DIRECTION:
        first, second = tangents(value)
        u = value + d[0] * first + d[1] * second
        return u / np.linalg.norm(u)
    return value + from_elements(form, d)


def _packed(form: Form, value: Any) -> Vector:
    return np.concatenate([value, *tangents(value)]) if form is Form.DIRECTION else np.ravel(value)


@dataclass(frozen=True)
class Prior:
    """Normal density of the parameters before anything is fitted, with independent components.

    Attributes
    ----------
    mean : (p,) in the order of NAMES. precision : (p,) 1 / variance; 0 where nothing is known.
    slope : (p,) added to the gradient, where that of V is not 0 in the mean at the true parameters.
    """

    mean: Vector
    precision: Vector
    slope: Vector | float = 0.0

    @classmethod
    def of(cls, **known: tuple[Vector | float, Vector | float]) -> Prior:
        """Build a prior from (mean, standard deviation) by keys of PLACES (D row-major, K as its six)."""
        mean, precision = np.zeros(len(NAMES)), np.zeros(len(NAMES))
        for name, (centre, sd) in known.items():
            mean[PLACES[name]], precision[PLACES[name]] = centre, 1.0 / np.square(sd)
        return cls(mean, precision)

    @classmethod
    def of_sensor(cls, flat: Flat, sensor: Sensor, **more: tuple[Vector | float, Vector | float]) -> Prior:
        """Build the table's priors, with b_omega by the flat segment and tau by the sensor's filters.

        more : further rows, as for Prior.of.
        """
        known = {row.name: (np.array(row.mean), np.array(row.sd)) for row in TABLE if row.sd}
        known["tau"] = (np.array(sensor.accel_lag_s), np.array(BY_NAME["tau"].sd))
        return cls.of(b_omega=(flat.b_omega, flat.b_omega_std), **known, **more)

    @property
    def precision_with_sensitivity(self) -> Vector:
        """Precisions (p + 9,) with those of the gyroscope's sensitivity to acceleration, by the data sheet."""
        return np.append(self.precision, np.full(SENSITIVE - HAND, SENSITIVITY_SD**-2))

    def cost(self, theta: Theta, parameters: int = HAND) -> float:
        """Return what adds to V: the sum of precision (x - mean)^2 / 2 + slope (x - mean) over the first parameters."""
        away = theta.values() - self.mean
        return float(np.sum((away * (0.5 * self.precision * away + self.slope))[:parameters]))

    def gradient(self, theta: Theta, parameters: int = HAND) -> Vector:
        """Return the gradient of `cost` by the first parameters."""
        return np.asarray((self.precision * (theta.values() - self.mean) + self.slope)[:parameters])
