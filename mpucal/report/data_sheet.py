"""The accelerometer's parameters compared with the chip's data sheet: usual, unusual, or outside."""

from __future__ import annotations

import math

import numpy as np

from ..chip.families import Family, family_of
from ..data import AXES, Vector
from ..origin import name_thing
from ..result.calibration import REFUSED, Calibration
from .elements import paragraph, table
from .units import ParameterRow, accelerometer, unbroken

USUAL, UNUSUAL, OUTSIDE = "usual", "unusual", "outside"
# share of the tolerance: two of the three standard deviations that it covers
UNUSUAL_FROM = 2.0 / 3.0
CAPTION = "value ± standard uncertainty (1 sigma)"
NOTE = (
    "Misalignment to y, in the column of x, is the angle from the sensitive axis x towards the board's axis y"
    " (cross-axis sensitivity); 1 mg is 0.00981 m/s²."
)


def accelerometer_table(c: Calibration, id_: str) -> str:
    """Return the table of scale factor errors, biases and misalignments, with the data sheet if it is known."""
    sheet = family_of(c.sensor.chip)
    rows = []
    for row in accelerometer(c):
        cells = [f"{row.name}, {row.unit}", *map(unbroken, row.cells)]
        if sheet is not None:
            compared = describe_comparison(row, sheet)
            corrected = "; corrected" if OUTSIDE in compared and c.verdict != REFUSED else ""
            cells.append(f"{_format_tolerance(tolerance(row, sheet))}: {compared}{corrected}")
        rows.append(cells)
    return table(id_, CAPTION, ["", *AXES, *(() if sheet is None else ("data sheet",))], rows, words=len(AXES))


def about(c: Calibration) -> str:
    """Return the notes on the table."""
    sheet, described = family_of(c.sensor.chip), name_thing(NOTE, c.sensor.origin)
    if sheet is None:
        return paragraph(described, note=True)
    return paragraph(
        f"{described} The data sheet is {sheet.data_sheet}; unusual means beyond two thirds of its tolerance."
        f" Its cross-axis sensitivity is ±{sheet.cross_axis_percent:g} %; its nonlinearity,"
        f" {sheet.nonlinearity_percent:g} % of the range, is not estimated.",
        note=True,
    )


def tolerance(row: ParameterRow, sheet: Family) -> Vector:
    """Return the tolerance (3,) of the data sheet in the row's unit."""
    if row.unit == "mg":
        return np.array(sheet.zero_g_mg)
    if row.unit == "%":
        return np.full(3, sheet.scale_percent)
    return np.full(3, sheet.misalignment_deg)


def describe_comparison(row: ParameterRow, sheet: Family) -> str:
    """Return the comparison in words, for each axis if they differ; empty if a value is not known."""
    judged = _by_axis(row, sheet)
    if len(set(judged.values())) == 1:
        return next(iter(judged.values()))
    return ", ".join(f"{axis} {words}" for axis, words in judged.items() if words != USUAL)


def unusual_parameters(c: Calibration) -> str:
    """Return a sentence on the unusual parameters; empty without a data sheet."""
    sheet = family_of(c.sensor.chip)
    if sheet is None:
        return ""
    named: dict[str, list[str]] = {}
    for row in accelerometer(c):
        for axis, words in _by_axis(row, sheet).items():
            of = " of" if " to " in row.name else ""
            named.setdefault(words, []).append(f"{row.name}{of} {axis}")
    heads = {OUTSIDE: "Outside the data sheet", UNUSUAL: "Unusual, but within the data sheet"}
    sentences = [f"{head}: {', '.join(named[words])}." for words, head in heads.items() if words in named]
    if sentences and c.verdict != REFUSED:
        sentences.append("This calibration corrects them.")
    return paragraph(" ".join(sentences) or "All parameters are usual by the data sheet.", "compared")


def _by_axis(row: ParameterRow, sheet: Family) -> dict[str, str]:
    return {
        axis: _judge(float(row.value[i]), float(row.std[i]), float(allowed))
        for i, (axis, allowed) in enumerate(zip(AXES, tolerance(row, sheet), strict=True))
        if axis in row.axes
    }


def _judge(value: float, std: float, allowed: float) -> str:
    # two standard deviations are allowed for the uncertainty
    size = abs(value) - (2.0 * std if math.isfinite(std) else 0.0)
    if not math.isfinite(size):
        return ""
    return OUTSIDE if size > allowed else UNUSUAL if size > UNUSUAL_FROM * allowed else USUAL


def _format_tolerance(allowed: Vector) -> str:
    """Return "±3", or "±50, ±50, ±80" if the axes differ."""
    texts = [f"±{value:.2g}" for value in allowed.tolist()]
    return texts[0] if len(set(texts)) == 1 else ", ".join(texts)
