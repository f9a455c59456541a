"""A calibration as a C header: its numbers as constants, and the functions that apply them."""

from __future__ import annotations

from collections.abc import Sequence

from ..result.calibration import Calibration
from .c_code import INCLUDES, at_temperature, of_counts
from .code import c_matrix, in_c
from .losses import head


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """The header's text (C99 or C++11), with `notes` in its head."""
    remarks = "\n".join(f" * {line}" for line in (f"{head(calibration)}.", *notes))
    return f"""/*
{remarks}
 */
#ifndef MPUCAL_CALIBRATION_H
#define MPUCAL_CALIBRATION_H

{INCLUDES}
/* y = D s + b_a, of the specific force s; for whoever wants to know: what is applied is its inverse. */
static const float MPUCAL_D[3][3] = {{
{c_matrix(calibration.D)}
}};

{in_c(calibration)}
{at_temperature(calibration)}
{of_counts(calibration)}
#endif
"""
