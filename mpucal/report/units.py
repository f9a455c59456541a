"""The parameters in the units of report and terminal: %, mg and deg, with standard uncertainties (1 sigma)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..data import AXES, Vector
from ..result import error_model
from ..result.calibration import REFUSED, Calibration, unknown
from ..result.error_model import with_std

# a standard uncertainty from here on, in the unit that is shown, means not observable
UNKNOWN = 100.0


class ParameterRow(NamedTuple):
    """Row of numbers of one kind for the axes x, y and z, NaN if unknown.

    Attributes
    ----------
    name, unit : of the row. value, std : (3,) of x, y and z. axes : those that the row has numbers for.
    """

    name: str
    unit: str
    value: Vector
    std: Vector
    axes: str = AXES

    @property
    def cells(self) -> list[str]:
        """Return "value ± standard uncertainty" for each axis; empty if the row has no number for it."""
        return [self._cell(i) if axis in self.axes else "" for i, axis in enumerate(AXES)]

    def _cell(self, axis: int) -> str:
        value, std = float(self.value[axis]), float(self.std[axis])
        return "not observable" if std >= UNKNOWN else with_std(value, std)


def accelerometer(c: Calibration) -> list[ParameterRow]:
    """Return scale factor error, bias and misalignments of the accelerometer."""
    bias = ParameterRow("bias", "mg", error_model.bias_mg(c.b_a), error_model.bias_mg(c.b_a_std))
    return _rows(c.D, c.D_std, bias)


def gyroscope(c: Calibration) -> list[ParameterRow]:
    """Return scale factor error, bias and misalignments of the gyroscope, y = inv(K) w + b_omega."""
    known = np.isfinite(c.K).all() and np.linalg.matrix_rank(c.K) == 3
    matrix = np.asarray(np.linalg.inv(c.K)) if known else unknown(3, 3)
    # for K near the identity, the standard deviations of inv(K) are those of K to first order
    bias = ParameterRow("bias", "deg/s", np.degrees(c.b_omega), np.degrees(c.b_omega_std))
    return _rows(matrix, c.K_std, bias)


def _rows(matrix: Vector, std: Vector, bias: ParameterRow) -> list[ParameterRow]:
    """Return scale factor error, bias, and three rows, each with the angles of the other two axes towards one axis."""
    gain, gain_std = error_model.scale_factor_error(matrix), error_model.scale_factor_error_std(std)
    angle, angle_std = error_model.misalignment(matrix), error_model.misalignment_std(matrix, std)
    misalignments = [
        ParameterRow(f"misalignment to {other}", "deg", angle[:, j], angle_std[:, j], AXES.replace(other, ""))
        for j, other in enumerate(AXES)
    ]
    return [ParameterRow("scale factor error", "%", gain, gain_std), bias, *misalignments]


def unbroken(text: str) -> str:
    """Return the text without a line break after ±, so that a narrow column breaks before it."""
    return text.replace("± ", "±\u00a0")


def estimated_error(c: Calibration) -> str:
    """Return a sentence on the estimated error of a calibrated acceleration; empty if unknown or refused."""
    error = c.quality.get("error_std") or {}
    known = (error.get("rms"), error.get("direction_deg"))
    rms, direction = (math.nan if value is None else float(value) for value in known)
    if c.verdict == REFUSED or not (math.isfinite(rms) and math.isfinite(direction)):
        return ""
    where = "the tilts that it is valid for" if c.fit.get("model") == "tilt" else "all orientations"
    return (
        f"Estimated error at rest: {_before(c)}{error_model.MG_PER_MPS2 * rms:.2g} mg after calibration (rms over"
        f" {where}, 1 sigma), {direction:.2g} deg in direction."
    )


def _before(c: Calibration) -> str:
    """Return the error before calibration as text; empty if not all orientations are known."""
    gravity = c.fit.get("gravity")
    if c.fit.get("model") == "tilt" or gravity is None:
        return ""
    before = error_model.error_before(c.D, c.b_a_to_subtract, gravity)
    return f"{error_model.MG_PER_MPS2 * before:.3g} mg before, "
