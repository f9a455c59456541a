"""C header, and C functions that apply a calibration: to m/s^2 and rad/s, with b_a(T), and to the chip's counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Vector
from ..result.calibration import Calibration
from .losses import heading, temperature_range

INCLUDES = "#include <stdint.h>\n#include <string.h>\n"


def c_functions(c: Calibration) -> str:
    """Return constants of inv(D), b_a, K and b_omega, and functions for firmware that apply them.

    Their names differ from those of mpucal_apply.h, so that a file can include both.
    """
    bias = _row(c.b_a_to_subtract)
    rate_bias = _row(np.nan_to_num(c.b_omega))
    accel_g, gyro_dps = c.sensor.accel_range_g, c.sensor.gyro_range_dps
    return f"""static const float MPUCAL_INV_D[3][3] = {{
{c_matrix(c.inverse)}
}};
static const float MPUCAL_B_A[3] = {{{bias}}}; /* m/s^2 */
static const float MPUCAL_K[3][3] = {{
{c_matrix(c.K)}
}};
static const float MPUCAL_B_OMEGA[3] = {{{rate_bias}}}; /* rad/s */

{_about("a", "m/s^2", accel_g, "g", STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS)}
static inline void mpucal_correct(const float y[3], float a[3])
{{
    for (int i = 0; i < 3; i++) {{
        a[i] = 0.0f;
        for (int j = 0; j < 3; j++)
            a[i] += MPUCAL_INV_D[i][j] * (y[j] - MPUCAL_B_A[j]);
    }}
}}

{_about("w", "rad/s", gyro_dps, "deg/s", np.radians(1) / GYRO_COUNTS)}
static inline void mpucal_correct_gyro(const float y[3], float w[3])
{{
    for (int i = 0; i < 3; i++) {{
        w[i] = 0.0f;
        for (int j = 0; j < 3; j++)
            w[i] += MPUCAL_K[i][j] * (y[j] - MPUCAL_B_OMEGA[j]);
    }}
}}
"""


def c_matrix(matrix: Vector) -> str:
    """Return the rows of a C initialiser, in float."""
    return ",\n".join(f"    {{{_row(row)}}}" for row in matrix)


def c_temperature_function(c: Calibration) -> str:
    """Return `mpucal_correct_at(y, temperature_c, a)`; it tests for NaN by its bits, since -ffast-math has no NaN."""
    at, start, end = temperature_range(c)
    return f"""static const float MPUCAL_SLOPE[3] = {{{_row(c.b_a_slope)}}}; /* m/s^2 per deg C; zeros: not known */
static const float MPUCAL_AT_C = {at:.8e}f, MPUCAL_FROM_C = {start:.8e}f, MPUCAL_TO_C = {end:.8e}f;

/* As mpucal_correct, with b_a(T) at the chip's temperature [deg C]; NaN if that is not known. */
static inline void mpucal_correct_at(const float y[3], float temperature_c, float a[3])
{{
    uint32_t bits;
    memcpy(&bits, &temperature_c, sizeof bits);
    float known = (bits & 0x7F800000u) == 0x7F800000u ? MPUCAL_AT_C : temperature_c;
    float within = known < MPUCAL_FROM_C ? MPUCAL_FROM_C : known > MPUCAL_TO_C ? MPUCAL_TO_C : known;
    float moved[3];
    for (int i = 0; i < 3; i++)
        moved[i] = y[i] - MPUCAL_SLOPE[i] * (within - MPUCAL_AT_C);
    mpucal_correct(moved, a);
}}
"""


def c_count_functions(c: Calibration) -> str:
    """Return functions of counts, which refuse another range than the calibration's at run time or compile time."""
    accel_g, gyro_dps = c.sensor.accel_range_g or 0.0, c.sensor.gyro_range_dps or 0.0
    checks = _check("MPUCAL_USED_RANGE_G", accel_g, "g") + _check("MPUCAL_USED_RANGE_DPS", gyro_dps, "deg/s")
    return f"""{checks}/* 0: not known */
static const float MPUCAL_RANGE_G = {accel_g:.8e}f, MPUCAL_RANGE_DPS = {gyro_dps:.8e}f;

/* Correct the chip's counts at +-range_g, its setting; return 0 and no a if this is not the calibration's range. */
static inline int mpucal_correct_counts(const int16_t counts[3], float range_g, float a[3])
{{
    float y[3];
    if (!(range_g > 0.0f) || (MPUCAL_RANGE_G > 0.0f && range_g != MPUCAL_RANGE_G))
        return 0;
    for (int i = 0; i < 3; i++)
        y[i] = (float)counts[i] * (range_g * 9.80665f / {ACCEL_COUNTS:.1f}f);
    mpucal_correct(y, a);
    return 1;
}}

/* As above for the gyroscope's counts at +-range_dps: 131 of them are 1 deg/s at +-250 deg/s. */
static inline int mpucal_correct_gyro_counts(const int16_t counts[3], float range_dps, float w[3])
{{
    float y[3];
    if (!(range_dps > 0.0f) || (MPUCAL_RANGE_DPS > 0.0f && range_dps != MPUCAL_RANGE_DPS))
        return 0;
    for (int i = 0; i < 3; i++)
        y[i] = (float)counts[i] * (range_dps * 0.01745329252f / {GYRO_COUNTS:.1f}f);
    mpucal_correct_gyro(y, w);
    return 1;
}}
"""


def _check(used: str, measured: float, unit: str) -> str:
    """Return a compile-time check of the range that the user's code sets."""
    if not measured or measured % 1:
        return ""
    return f"""/* Define {used} as the range that your code sets, an integer: any other than this does not compile. */
#if defined({used}) && {used} != {measured:g}
#error "mpucal: this calibration is of +-{measured:g} {unit}, but {used} is another range"
#endif
"""


def _about(result: str, unit: str, full_scale: float | None, of: str, per_count: float) -> str:
    """Return a comment on y and `result`, and on a count, which is `full_scale` times `per_count`."""
    line = f"/* y: as measured, {result}: calibrated, both in {unit}. */"
    if full_scale is None:
        return line
    return f"{line}\n/* At +-{full_scale:g} {of} one count of the chip is {full_scale * per_count:.9g} {unit}. */"


def _row(values: Vector) -> str:
    return ", ".join(f"{value:.8e}f" for value in values)


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
