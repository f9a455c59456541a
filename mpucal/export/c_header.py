"""A calibration as a C header: D, inv(D) and b_a as constants, and the function that applies them."""

from __future__ import annotations

from ..report.use import c_matrix, in_c
from ..result.calibration import Calibration
from .losses import check_usable, head, in_float, with_hardware, without_gyroscope, without_temperature

ENDING = ".h"


def export(calibration: Calibration) -> tuple[str, tuple[str, ...]]:
    """The header's text (C99 or C++11), and what it cannot carry.

    Raises
    ------
    RefusedError : see losses.check_usable.
    """
    check_usable(calibration)
    notes = (
        *in_float(calibration),
        *without_gyroscope(calibration),
        *without_temperature(calibration),
        *with_hardware(calibration),
    )
    remarks = "\n".join(f" * {line}" for line in (f"{head(calibration)}.", *notes))
    text = f"""/*
{remarks}
 */
#ifndef MPUCAL_CALIBRATION_H
#define MPUCAL_CALIBRATION_H

/* y = D s + b_a, of the specific force s; for whoever wants to know: what is applied is its inverse. */
static const float MPUCAL_D[3][3] = {{
{c_matrix(calibration.D)}
}};

{in_c(calibration)}
#endif
"""
    return text, notes
