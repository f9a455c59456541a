"""The accelerometer's parameters beside the chip's data sheet: usual, unusual, or outside of it."""

from __future__ import annotations

import math

import numpy as np

from ..chip.families import Family, family_of
from ..data import Vector
from ..result.calibration import Calibration
from .elements import paragraph, table
from .units import AXES, ParameterRow, accelerometer

USUAL, UNUSUAL, OUTSIDE = "usual", "unusual", "outside the data sheet"
# of a tolerance that is three standard deviations of what leaves the factory, two
UNUSUAL_FROM = 2.0 / 3.0
CAPTION = "value ± standard uncertainty (1 sigma)"
NOTE = (
    "Misalignment x->y is the angle from the sensitive axis x towards the board's axis y (cross-axis sensitivity);"
    " 1 mg is 0.00981 m/s²."
)


def accelerometer_table(c: Calibration, id_: str) -> str:
    """Scale factor errors, biases and misalignments, beside the data sheet where that is at hand."""
    sheet = family_of(c.sensor.chip)
    rows = []
    for row in accelerometer(c):
        # where a column is narrow, the deviation goes below its value as a whole
        cells = [f"{row.name}, {row.unit}", *(cell.replace("± ", "±\u00a0") for cell in row.cells)]
        if sheet is not None:
            cells.append(f"{_said(tolerance(row, sheet))}: {comparison(row, sheet)}")
        rows.append(cells)
    return table(id_, CAPTION, ["", *AXES, *(() if sheet is None else ("data sheet",))], rows, words=len(AXES))


def about(c: Calibration) -> str:
    """What the table shows, and what stands in no table."""
    sheet = family_of(c.sensor.chip)
    if sheet is None:
        return paragraph(NOTE, note=True)
    return paragraph(
        f"{NOTE} The data sheet is {sheet.data_sheet}: unusual is beyond two thirds of its tolerance."
        f" Its cross-axis sensitivity is ±{sheet.cross_axis_percent:g} %; its nonlinearity,"
        f" {sheet.nonlinearity_percent:g} % of the range, is not estimated.",
        note=True,
    )


def tolerance(row: ParameterRow, sheet: Family) -> Vector:
    """(3,) what the data sheet allows, in the row's unit."""
    if row.unit == "mg":
        return np.array(sheet.zero_g_mg)
    if row.unit == "%":
        return np.full(3, sheet.scale_percent)
    return np.full(3, math.degrees(math.atan(0.01 * sheet.cross_axis_percent)))


def comparison(row: ParameterRow, sheet: Family) -> str:
    """In words, for each axis where they differ; empty where a value is not known."""
    judged = _by_axis(row, sheet)
    if len(set(judged.values())) == 1:
        return next(iter(judged.values()))
    return ", ".join(f"{axis} {words}" for axis, words in judged.items() if words != USUAL)


def compared(c: Calibration) -> str:
    """What is not usual, in a sentence; empty without a data sheet."""
    sheet = family_of(c.sensor.chip)
    if sheet is None:
        return ""
    named: dict[str, list[str]] = {OUTSIDE: [], UNUSUAL: []}
    for row in accelerometer(c):
        for axis, words in _by_axis(row, sheet).items():
            named.get(words, []).append(row.name if len(row.axes) == 1 else f"{row.name} {axis}")
    said = [f"{words[:1].upper()}{words[1:]}: {', '.join(names)}." for words, names in named.items() if names]
    return paragraph(" ".join(said) or "All of it is usual by the data sheet.", "compared")


def _by_axis(row: ParameterRow, sheet: Family) -> dict[str, str]:
    return {
        axis: _judged(float(row.value[i]), float(row.std[i]), float(allowed))
        for i, (axis, allowed) in enumerate(zip(AXES, tolerance(row, sheet), strict=True))
        if axis in row.axes
    }


def _judged(value: float, std: float, allowed: float) -> str:
    # what two standard deviations may explain is not held against the chip
    size = abs(value) - (2.0 * std if math.isfinite(std) else 0.0)
    if not math.isfinite(size):
        return ""
    return OUTSIDE if size > allowed else UNUSUAL if size > UNUSUAL_FROM * allowed else USUAL


def _said(allowed: Vector) -> str:
    """ "±3", or "±50, ±50, ±80" where the axes differ."""
    texts = [f"±{value:.2g}" for value in allowed.tolist()]
    return texts[0] if len(set(texts)) == 1 else ", ".join(texts)
