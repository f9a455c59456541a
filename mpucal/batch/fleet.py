"""Statistics of a fleet: parameters of all rows in common units, robust against a few bad boards."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..chip.families import PARTS, Family
from ..data import AXES, Vector
from ..rests.limits import OF_NORMAL
from ..result.calibration import REFUSED
from ..result.error_model import bias_mg, misalignment, scale_factor_error

# robust standard deviations from the fleet's median, beyond which a value is an outlier
OUTLIER_STD = 5.0


@dataclass(frozen=True)
class Parameter:
    """Parameter of all boards.

    Attributes
    ----------
    name, unit : as text. value : (n,) NaN if not known. limit : (n,) of the chip's data sheet, NaN without.
    """

    name: str
    unit: str
    value: Vector
    limit: Vector

    @property
    def known(self) -> Vector:
        """Return the (k,) known values."""
        return np.asarray(self.value[np.isfinite(self.value)])

    @property
    def middle(self) -> tuple[float, float]:
        """Return median and robust standard deviation; NaN without values."""
        if not len(self.known):
            return np.nan, np.nan
        median = float(np.median(self.known))
        return median, float(np.median(np.abs(self.known - median))) * OF_NORMAL

    @property
    def beyond(self) -> int:
        """Return the number of values beyond the data sheet's limit."""
        with np.errstate(invalid="ignore"):
            return int(np.sum(np.abs(self.value) > self.limit))

    def outliers(self) -> Iterator[tuple[int, float]]:
        """Yield (row, distance in robust standard deviations) of each outlier."""
        median, spread = self.middle
        if spread > 0.0:
            away = np.abs(self.value - median) / spread
            for i in np.flatnonzero(np.nan_to_num(away) > OUTLIER_STD):
                yield int(i), float(away[i])


def parameters(columns: Mapping[str, Sequence[Any]]) -> list[Parameter]:
    """Return scale factor error, bias and largest misalignment of the accelerometer, and the gyroscope's biases.

    Refused calibrations are left out.
    """
    refused = np.array([verdict in (None, REFUSED) for verdict in columns["verdict"]], bool)
    D = _numbers(columns, [f"D_{i}{j}" for i in AXES for j in AXES]).reshape(-1, 3, 3)
    b_a, b_omega = (_numbers(columns, [f"{name}_{i}" for i in AXES]) for name in ("b_a", "b_omega"))
    for values in (D, b_a, b_omega):
        values[refused] = np.nan
    families = [PARTS[number].family if number in PARTS else None for number in columns["who_am_i"]]

    def tolerance(of: Callable[[Family], Any]) -> Vector:
        """Return (n, 3) of the data sheets; NaN without."""
        rows = [np.full(3, np.nan) if family is None else np.broadcast_to(of(family), 3) for family in families]
        return np.array(rows, float).reshape(-1, 3)

    rows = (
        ("scale factor error {}", "%", scale_factor_error(D), tolerance(lambda family: family.scale_percent)),
        ("bias {}", "mg", bias_mg(b_a), tolerance(lambda family: family.zero_g_mg)),
        ("gyroscope's bias {}", "deg/s", np.degrees(b_omega), tolerance(lambda family: family.zero_rate_dps)),
    )
    made = [
        Parameter(name.format(axis), unit, values[:, k], limit[:, k])
        for name, unit, values, limit in rows
        for k, axis in enumerate(AXES)
    ]
    angles = misalignment(D)[:, ~np.eye(3, dtype=bool)]
    allowed = tolerance(lambda family: family.misalignment_deg)[:, 0]
    made.insert(2 * len(AXES), Parameter("largest misalignment", "deg", np.max(np.abs(angles), axis=1), allowed))
    return made


def repeated_sensors(columns: Mapping[str, Sequence[Any]]) -> list[tuple[int, int]]:
    """Return pairs of successive rows of one sensor, by its factory trim, from different files."""
    seen: dict[str, list[int]] = {}
    for i, (sensor, verdict) in enumerate(zip(columns["sensor"], columns["verdict"], strict=True)):
        if sensor is not None and verdict not in (None, REFUSED):
            seen.setdefault(sensor, []).append(i)
    pairs = (pair for rows in seen.values() for pair in pairwise(rows))
    return [(i, j) for i, j in pairs if columns["digest"][i] != columns["digest"][j]]


def repeatability(columns: Mapping[str, Sequence[Any]], pairs: Sequence[tuple[int, int]]) -> list[tuple[str, Vector]]:
    """Return for D and for b_a the differences of pairs (pairs, elements) in their standard deviations."""
    first, second = np.array(pairs, int).reshape(-1, 2).T
    found = []
    for name, places in (("D", [f"{i}{j}" for i in AXES for j in AXES]), ("b_a", list(AXES))):
        value, std = (_numbers(columns, [f"{what}_{place}" for place in places]) for what in (name, f"{name}_std"))
        found.append((name, np.asarray((value[second] - value[first]) / np.hypot(std[first], std[second]))))
    return found


def _numbers(columns: Mapping[str, Sequence[Any]], names: Sequence[str]) -> Vector:
    """Return (n, names)."""
    return np.array([columns[name] for name in names], float).T
