"""How the errors of a calibration's 21 numbers hang together: their correlation, as in calibration.json.

The numbers are those of NAMES: D row-major, b_a, K's upper triangle, and b_omega. With their standard deviations the
correlation (21, 21) makes their covariance. The file holds what is below the diagonal, row by row, 210 numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..data import Vector

_AXES, _PAIRS = ("x", "y", "z"), ("xx", "xy", "xz", "yy", "yz", "zz")
NAMES = (
    *(f"D_{i}{j}" for i in _AXES for j in _AXES),
    *(f"b_a_{i}" for i in _AXES),
    *(f"K_{pair}" for pair in _PAIRS),
    *(f"b_omega_{i}" for i in _AXES),
)
KEY, LOWER = "correlation", np.tril_indices(len(NAMES), -1)
_UPPER = np.triu_indices(3)
# beyond them is nothing that another processor computes alike
DIGITS = 5
# or not known to be correlated
UNCORRELATED = np.eye(len(NAMES))


def correlation_of(names: Sequence[str], covariance: Vector, std: Vector) -> Vector:
    """(21, 21) of the covariance (p, p) of estimates by name, with their standard deviations (21,) in NAMES' order.

    What was not estimated, and what has no standard deviation, hangs together with nothing. The standard deviations
    may be larger than the covariance's: then the correlations are the smaller.
    """
    of = [(at, names.index(name)) for at, name in enumerate(NAMES) if name in names and std[at] > 0.0]
    rho = UNCORRELATED.copy()
    if of:
        ours, theirs = (np.array(column) for column in zip(*of, strict=True))
        rho[np.ix_(ours, ours)] = covariance[np.ix_(theirs, theirs)] / np.outer(std[ours], std[ours])
    below: Vector = np.clip(rho[LOWER], -1.0, 1.0)
    return from_lower(below.round(DIGITS))


def from_lower(values: Vector) -> Vector:
    """(21, 21) of the (210,) below its diagonal; what is not known (NaN) is 0."""
    rho = np.zeros((len(NAMES), len(NAMES)))
    rho[LOWER] = np.nan_to_num(values)
    return np.asarray(rho + rho.T + UNCORRELATED)


def standard_deviations(values: Mapping[str, Any]) -> Vector:
    """(21,) of a Calibration's fields by name, in the order of NAMES."""
    K_std = np.asarray(values["K_std"])[_UPPER]
    return np.concatenate([np.ravel(values["D_std"]), values["b_a_std"], K_std, values["b_omega_std"]])
