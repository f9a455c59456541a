"""The parameters as report and terminal show them: %, mg and deg, with standard uncertainties (1 sigma)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data import Vector
from ..result import error_model
from ..result.calibration import REFUSED, Calibration, unknown

AXES = error_model.AXES
# standard uncertainties from here on, in the unit that is shown, are said to be not observable
UNKNOWN = 100.0


@dataclass(frozen=True)
class ParameterRow:
    """Numbers of one kind for the axes x, y and z, NaN where unknown.

    Attributes
    ----------
    name, unit : of the row. value, std : (3,) of x, y and z. axes : those that the row has a number for.
    """

    name: str
    unit: str
    value: Vector
    std: Vector
    axes: str = AXES

    @property
    def cells(self) -> list[str]:
        """value ± standard uncertainty, one text an axis; empty where the row has none."""
        return [self._cell(i) if axis in self.axes else "" for i, axis in enumerate(AXES)]

    def _cell(self, axis: int) -> str:
        value, std = float(self.value[axis]), float(self.std[axis])
        return "not observable" if std >= UNKNOWN else with_std(value, std)


def accelerometer(c: Calibration) -> list[ParameterRow]:
    """Scale factor error, bias and misalignment of each axis."""
    bias = ParameterRow("bias", "mg", error_model.bias_mg(c.b_a), error_model.bias_mg(c.b_a_std))
    return [_scale_factor_error(c.D, c.D_std), bias, *_misalignments(c.D, c.D_std)]


def gyroscope(c: Calibration) -> list[ParameterRow]:
    """The same of the gyroscope, y = inv(K) w + b_omega."""
    known = np.isfinite(c.K).all() and np.linalg.matrix_rank(c.K) == 3
    matrix = np.asarray(np.linalg.inv(c.K)) if known else unknown(3, 3)
    # the deviations of inv(K) are those of K to first order, which is what a K near the identity is good for
    bias = ParameterRow("bias", "deg/s", np.degrees(c.b_omega), np.degrees(c.b_omega_std))
    return [_scale_factor_error(matrix, c.K_std), bias, *_misalignments(matrix, c.K_std)]


def _scale_factor_error(matrix: Vector, std: Vector) -> ParameterRow:
    value = error_model.scale_factor_error(matrix)
    return ParameterRow("scale factor error", "%", value, error_model.scale_factor_error_std(std))


def _misalignments(matrix: Vector, std: Vector) -> list[ParameterRow]:
    """Six rows, each with one number in the column of the axis that is misaligned."""
    angle, angle_std = error_model.misalignment(matrix), error_model.misalignment_std(matrix, std)
    return [
        ParameterRow(f"misalignment {axis}->{other}", "deg", angle[:, j], angle_std[:, j], axis)
        for axis in AXES
        for j, other in enumerate(AXES)
        if axis != other
    ]


def with_std(value: float, std: float, most_digits: int = 5) -> str:
    """A value ± its standard uncertainty, to the second digit of that."""
    if not math.isfinite(value):
        return "unknown"
    if not math.isfinite(std) or std <= 0.0:
        return f"{value:+.3f} ± ?"
    digits = min(max(1 - math.floor(math.log10(std)), 0), most_digits)
    return f"{value:+.{digits}f} ± {std:.{digits}f}"


def estimated_error(c: Calibration) -> str:
    """The estimated error of a calibrated acceleration in a sentence; empty where unknown or refused."""
    error = c.quality.get("error_std") or {}
    known = (error.get("rms"), error.get("direction_deg"))
    rms, direction = (math.nan if value is None else float(value) for value in known)
    if c.verdict == REFUSED or not (math.isfinite(rms) and math.isfinite(direction)):
        return ""
    where = "the tilts that it holds for" if c.fit.get("model") == "tilt" else "all orientations"
    return (
        f"Estimated error at rest: {_before(c)}{error_model.MG_PER_MPS2 * rms:.2g} mg rms (1 sigma) over {where} after"
        f" calibration, {direction:.2g} deg in direction."
    )


def _before(c: Calibration) -> str:
    """What the error was, where all orientations are known."""
    gravity = c.fit.get("gravity")
    if c.fit.get("model") == "tilt" or gravity is None:
        return ""
    before = error_model.error_before(c.D, c.b_a_to_subtract, gravity)
    return f"{error_model.MG_PER_MPS2 * before:.3g} mg before, "
