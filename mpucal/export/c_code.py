"""C header, and C functions that apply a calibration: to m/s^2 and rad/s, with b_a(T), and to the chip's counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import ACCEL_COUNTS, GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Vector
from ..result.calibration import Calibration
from .losses import heading, temperature_range
from .templates import fill


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the header's text (C99 or C++11), with `notes` in its heading."""
    return fill(
        "header.h",
        heading="\n".join(heading(calibration, notes, " * ")),
        D=_matrix(calibration.D),
        functions=c_functions(calibration),
        counts=_count_functions(calibration),
    )


def c_functions(c: Calibration) -> str:
    """Return constants of inv(D), b_a, K and b_omega, and functions for firmware that apply them.

    Their names differ from those of mpucal_apply.h, so that a file can include both. The function of temperature tests
    for NaN by its bits, since -ffast-math has no NaN.
    """
    at, start, end = map(_number, temperature_range(c))
    return fill(
        "functions.c",
        inv_D=_matrix(c.inverse),
        b_a=_row(c.b_a_to_subtract),
        K=_matrix(c.K),
        b_omega=_row(np.nan_to_num(c.b_omega)),
        about_a=_about("a", "m/s^2", c.sensor.accel_range_g, "g", STANDARD_GRAVITY_MPS2 / ACCEL_COUNTS),
        about_w=_about("w", "rad/s", c.sensor.gyro_range_dps, "deg/s", np.radians(1) / GYRO_COUNTS),
        slope=_row(c.b_a_slope),
        at=at,
        start=start,
        end=end,
    )


def _count_functions(c: Calibration) -> str:
    """Return functions of counts, which refuse another range than the calibration's at run time or compile time."""
    accel_g, gyro_dps = c.sensor.accel_range_g or 0.0, c.sensor.gyro_range_dps or 0.0
    return fill(
        "counts.c",
        checks=_check("MPUCAL_USED_RANGE_G", accel_g, "g") + _check("MPUCAL_USED_RANGE_DPS", gyro_dps, "deg/s"),
        range_g=_number(accel_g),
        range_dps=_number(gyro_dps),
        accel_counts=ACCEL_COUNTS,
        gyro_counts=GYRO_COUNTS,
    )


def _check(used: str, measured: float, unit: str) -> str:
    """Return a compile-time check of the range that the user's code sets."""
    return "" if not measured or measured % 1 else fill("check.c", used=used, measured=f"{measured:g}", unit=unit)


def _about(result: str, unit: str, full_scale: float | None, of: str, per_count: float) -> str:
    """Return a comment on y and `result`, and on a count, which is `full_scale` times `per_count`."""
    line = f"/* y: as measured, {result}: calibrated, both in {unit}. */"
    if full_scale is None:
        return line
    return f"{line}\n/* At +-{full_scale:g} {of} one count of the chip is {full_scale * per_count:.9g} {unit}. */"


def _matrix(matrix: Vector) -> str:
    """Return the rows of a C initialiser, in float."""
    return ",\n".join(f"    {{{_row(row)}}}" for row in matrix)


def _row(values: Vector) -> str:
    return ", ".join(map(_number, values))


def _number(value: float) -> str:
    return f"{value:.8e}f"
