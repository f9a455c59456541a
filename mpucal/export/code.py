"""Code that applies a calibration, to m/s^2 and rad/s, with b_a(T): C functions, and modules of Python.

The C functions stand in a header, with those for the chip's counts, and in an Arduino sketch, which reads the chip over
Wire. One module needs only NumPy; the other is for MicroPython or CircuitPython, and corrects one sample at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..chip.config import Config
from ..chip.families import MPU6050, family_of
from ..chip.registers import ACCEL_RANGES_G, FULL_SCALE_SHIFT, GYRO_RANGES_DPS
from ..data import ACCEL_COUNTS, GYRO_COUNTS, mps2_per_count, rad_s_per_count
from ..result.calibration import Calibration
from .losses import heading, temperature_range
from .templates import fill, row, rows

FLOAT = "{:.8e}f"


def header(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the header's text (C99 or C++11), with `notes` in its heading."""
    return fill(
        "header.h",
        heading="\n".join(heading(calibration, notes, " * ")),
        D=rows(calibration.D, FLOAT, "{}"),
        functions=c_functions(calibration),
        counts=_count_functions(calibration),
    )


def c_functions(c: Calibration) -> str:
    """Return constants of inv(D), b_a, K and b_omega, and functions for firmware that apply them.

    Their names differ from those of mpucal_apply.h, so that a file can include both. The function of temperature tests
    for NaN by its bits, since -ffast-math has no NaN.
    """
    at, start, end = map(FLOAT.format, temperature_range(c))
    return fill(
        "functions.c",
        inv_D=rows(c.inverse, FLOAT, "{}"),
        b_a=row(c.b_a_to_subtract, FLOAT),
        K=rows(c.K, FLOAT, "{}"),
        b_omega=row(np.nan_to_num(c.b_omega), FLOAT),
        about_a=_about("a", "m/s^2", c.sensor.accel_range_g, "g", mps2_per_count),
        about_w=_about("w", "rad/s", c.sensor.gyro_range_dps, "deg/s", rad_s_per_count),
        slope=row(c.b_a_slope, FLOAT),
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
        range_g=FLOAT.format(accel_g),
        range_dps=FLOAT.format(gyro_dps),
        accel_counts=ACCEL_COUNTS,
        gyro_counts=GYRO_COUNTS,
    )


def _check(used: str, measured: float, unit: str) -> str:
    """Return a compile-time check of the range that the user's code sets."""
    return "" if not measured or measured % 1 else fill("check.c", used=used, measured=f"{measured:g}", unit=unit)


def _about(result: str, unit: str, full_scale: float | None, of: str, per_count: Callable[[float], float]) -> str:
    """Return a comment on y and `result`, and on a count, which is `per_count` of `full_scale`."""
    line = f"/* y: as measured, {result}: calibrated, both in {unit}. */"
    if full_scale is None:
        return line
    return f"{line}\n/* At +-{full_scale:g} {of} one count of the chip is {per_count(full_scale):.9g} {unit}. */"


ACCEL_CONFIG = {float(g): code << FULL_SCALE_SHIFT for code, g in enumerate(ACCEL_RANGES_G)}
GYRO_CONFIG = {float(dps): code << FULL_SCALE_SHIFT for code, dps in enumerate(GYRO_RANGES_DPS)}


def sketch(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the sketch's text, with `notes` in its heading."""
    sensor = calibration.sensor
    range_g = sensor.accel_range_g if sensor.accel_range_g in ACCEL_CONFIG else Config.accel_range_g
    range_dps = sensor.gyro_range_dps if sensor.gyro_range_dps in GYRO_CONFIG else Config.gyro_range_dps
    family = family_of(sensor.chip) or MPU6050
    return fill(
        "sketch.ino",
        heading="\n".join(heading(calibration, notes, "// ", "m/s^2, rad/s")),
        functions=c_functions(calibration),
        accel_config=f"0x{ACCEL_CONFIG[range_g]:02x}",
        gyro_config=f"0x{GYRO_CONFIG[range_dps]:02x}",
        range_g=f"{range_g:g}",
        range_dps=f"{range_dps:g}",
        accel_counts=f"{ACCEL_COUNTS:.0f}",
        gyro_counts=f"{GYRO_COUNTS:.0f}",
        lsb_per_c=f"{family.lsb_per_c:g}",
        zero_c=f"{family.zero_c:g}",
    )


def sketch_losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on assumptions of the sketch."""
    sensor, notes = calibration.sensor, ["It reads the chip at address 0x68: if AD0 is high, change CHIP to 0x69."]
    if sensor.accel_range_g not in ACCEL_CONFIG:
        notes.append(f"It sets +-{Config.accel_range_g:g} g, but the calibration is of another or unknown range.")
    if sensor.gyro_range_dps not in GYRO_CONFIG:
        notes.append(f"It sets +-{Config.gyro_range_dps:g} deg/s, but the calibration is of another or unknown range.")
    if family_of(sensor.chip) is None and calibration.follows_temperature:
        notes.append("It assumes the thermometer of an MPU-6050; `mpucal doctor` shows which chip it is.")
    return tuple(notes)


def numpy_text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the text of the module for NumPy, with `notes` in its docstring."""
    head = "\n\n".join(heading(calibration, notes, "", "m/s^2, rad/s"))
    return _module("module.py", calibration, head, "{:.12g}", "[]", "{:.6g}")


def micropython_text(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return the text of the module for MicroPython, with `notes` in its heading."""
    return _module(
        "micropython.py",
        calibration,
        "\n".join(heading(calibration, notes, "# ", "m/s^2, rad/s")),
        "{:.9g}",
        "()",
        "{:.9g}",
        ranges=f"{calibration.sensor.accel_range_g}, {calibration.sensor.gyro_range_dps}",
        mps2_per_g_count=f"{mps2_per_count(1.0):.9g}",
        rad_s_per_dps_count=f"{rad_s_per_count(1.0):.9g}",
    )


def _module(name: str, c: Calibration, head: str, form: str, brackets: str, of_t: str, **more: str) -> str:
    return fill(
        name,
        heading=head,
        inv_D=rows(c.inverse, form, brackets),
        b_a=row(c.b_a_to_subtract, form),
        slope=row(c.b_a_slope, form),
        temperatures=row(temperature_range(c), of_t),
        K=rows(c.K, form, brackets),
        b_omega=row(np.nan_to_num(c.b_omega), form),
        **more,
    )
