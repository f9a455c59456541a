"""Correlation of the errors of a calibration's 21 numbers, as in calibration.json.

The numbers are those of NAMES: D row-major, b_a, K's upper triangle, and b_omega. With their standard deviations the
correlation (21, 21) gives their covariance. The file holds the 210 numbers below the diagonal, row by row.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..data import AXES, Vector

_PAIRS = ("xx", "xy", "xz", "yy", "yz", "zz")
NAMES = (
    *(f"D_{i}{j}" for i in AXES for j in AXES),
    *(f"b_a_{i}" for i in AXES),
    *(f"K_{pair}" for pair in _PAIRS),
    *(f"b_omega_{i}" for i in AXES),
)
KEY = "correlation"
LOWER = np.tril_indices(len(NAMES), -1)
UPPER = np.triu_indices(3)
# also the value if the correlation is not known
UNCORRELATED = np.eye(len(NAMES))


def correlation_of(names: Sequence[str], covariance: Vector, std: Vector) -> Vector:
    """Return the correlation (21, 21) from a covariance (p, p) of named estimates and standard deviations (21,).

    Parameters
    ----------
    names : of the p estimates. std : in the order of NAMES; they may exceed those of the covariance, which makes the
        correlations smaller. Numbers that were not estimated or have no standard deviation are uncorrelated.
    """
    of = [(at, names.index(name)) for at, name in enumerate(NAMES) if name in names and std[at] > 0.0]
    rho = UNCORRELATED.copy()
    if of:
        ours, theirs = (np.array(column) for column in zip(*of, strict=True))
        rho[np.ix_(ours, ours)] = covariance[np.ix_(theirs, theirs)] / np.outer(std[ours], std[ours])
    below: Vector = np.clip(rho[LOWER], -1.0, 1.0)
    # further digits differ between processors
    return from_lower(below.round(5))


def from_lower(values: Vector) -> Vector:
    """Return the correlation (21, 21) from the (210,) numbers below its diagonal; NaN becomes 0."""
    rho = np.zeros((len(NAMES), len(NAMES)))
    rho[LOWER] = np.nan_to_num(values)
    return np.asarray(rho + rho.T + UNCORRELATED)


def standard_deviations(values: Mapping[str, Any]) -> Vector:
    """Return the standard deviations (21,) of a Calibration's fields, in the order of NAMES."""
    K_std = np.asarray(values["K_std"])[UPPER]
    return np.concatenate([np.ravel(values["D_std"]), values["b_a_std"], K_std, values["b_omega_std"]])
