"""A point in the space of all parameters: a step from it, its numbers one by one, and its layout for the kernel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..data import Vector
from .parameters import NAMES, PLACES, TABLE, Form, Parameter
from .sphere import tangents

UPPER = np.triu_indices(3)


@dataclass(frozen=True)
class Theta:
    """All parameters of the model, as the table's rows describe them; those not estimated keep their start.

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
        """What is given, and the table's starting values: a perfect gyro and no hand."""
        values = {row.field: from_elements(row.form, np.array(row.mean)) for row in TABLE if row.field != "u"}
        return cls(**{**values, "D": D, "b_a": b_a, "b_omega": b_omega, "u": u})

    def moved(self, delta: Vector) -> Theta:
        """theta + delta, delta (p,) in the order of NAMES; the tilts turn u and keep it a unit vector."""
        d = np.zeros(len(NAMES))
        d[: len(delta)] = delta
        moved = {row.field: _moved(row.form, getattr(self, row.field), d[PLACES[row.name]]) for row in TABLE}
        return replace(self, **moved)

    def packed(self, rows: Sequence[Parameter]) -> Vector:
        """The kernel's structure of these rows: matrices whole, u with its derivatives by the tilts."""
        return np.concatenate([_packed(row.form, getattr(self, row.field)) for row in rows])


def values(theta: Theta) -> Vector:
    """(p,) in the order of NAMES; the tilts are zero by definition."""
    return np.concatenate([_elements(row.form, getattr(theta, row.field)) for row in TABLE])


def from_elements(form: Form, elements: Vector) -> Any:
    """The matrix, vector or number whose parameters these are."""
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
