"""A calibration as a C header: its numbers as constants, and functions that apply them."""

from __future__ import annotations

from collections.abc import Sequence

from ..result.calibration import Calibration
from .c_code import INCLUDES, c_count_functions, c_functions, c_matrix, c_temperature_function
from .losses import heading


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the header's text (C99 or C++11), with `notes` in its heading."""
    remarks = "\n".join(heading(calibration, notes, " * "))
    return f"""/*
{remarks}
 */
#ifndef MPUCAL_CALIBRATION_H
#define MPUCAL_CALIBRATION_H

{INCLUDES}
/* y = D s + b_a, with the specific force s; for information: the functions use its inverse. */
static const float MPUCAL_D[3][3] = {{
{c_matrix(calibration.D)}
}};

{c_functions(calibration)}
{c_temperature_function(calibration)}
{c_count_functions(calibration)}
#endif
"""
