"""What C code does with a calibration besides in_c: b_a(T), and the chip's counts at the range that it is set to."""

from __future__ import annotations

from ..data import ACCEL_COUNTS, GYRO_COUNTS
from ..result.calibration import Calibration
from .code import temperatures

INCLUDES = "#include <stdint.h>\n#include <string.h>\n"


def at_temperature(c: Calibration) -> str:
    """`mpucal_correct_at(y, temperature_c, a)`: NaN is told by its bits, since -ffast-math has no NaN."""
    at, start, end = temperatures(c)
    slope = ", ".join(f"{v:.8e}f" for v in c.b_a_slope)
    return f"""static const float MPUCAL_SLOPE[3] = {{{slope}}}; /* of b_a, m/s^2 per deg C; zeros: not known */
static const float MPUCAL_AT_C = {at:.8e}f, MPUCAL_FROM_C = {start:.8e}f, MPUCAL_TO_C = {end:.8e}f;

/* The same with b_a(T) at the chip's temperature [deg C]; one that is not known, NaN, is that of b_a. */
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


def of_counts(c: Calibration) -> str:
    """Functions of counts: each refuses another range than the calibration's, or does not compile."""
    accel_g, gyro_dps = c.sensor.accel_range_g or 0.0, c.sensor.gyro_range_dps or 0.0
    checks = _check("MPUCAL_USED_RANGE_G", accel_g, "g") + _check("MPUCAL_USED_RANGE_DPS", gyro_dps, "deg/s")
    return f"""{checks}/* 0: not known */
static const float MPUCAL_RANGE_G = {accel_g:.8e}f, MPUCAL_RANGE_DPS = {gyro_dps:.8e}f;

/* a of the chip's counts at +-range_g, to which it is set; 0, and no a, where that is not the calibration's range. */
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

/* The same of the gyroscope's counts at +-range_dps: 131 of them are 1 deg/s at +-250 deg/s. */
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
    if not measured or measured % 1:
        return ""
    return f"""/* Define {used} as the range that your code sets, an integer: another one than this does not compile. */
#if defined({used}) && {used} != {measured:g}
#error "mpucal: this calibration is of +-{measured:g} {unit}, and {used} is another range"
#endif
"""
