"""Notes on the parts of a calibration that an export form cannot hold, with the remaining error, and headings."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

from ..chip.families import PARTS
from ..chip.registers import GYRO_RANGES_DPS
from ..data import GYRO_COUNTS, STANDARD_GRAVITY_MPS2, Vector
from ..errors import RefusedError
from ..result.calibration import Calibration

# calibration -> sentences on the parts of it that a form cannot hold
LossNotes = Callable[[Calibration], tuple[str, ...]]

# characters that might end a comment or a string in one of the forms' languages
UNSAFE = re.compile(r"[^A-Za-z0-9_ .,:+()-]")

FLOAT_EPS = float(np.finfo(np.float32).eps)


def check_usable(calibration: Calibration) -> None:
    """Check that a calibration may be exported.

    Raises
    ------
    RefusedError : it was refused, or D or b_a is unknown, or D cannot be inverted.
    """
    if calibration.objection:
        remedy = "calibrate again, and follow the remedies of its reasons"
        raise RefusedError(f"nothing was exported: {calibration.objection}", remedy)


def heading(calibration: Calibration, notes: Sequence[str], prefix: str, units: str = "m/s^2") -> list[str]:
    """Return comment lines on the content of a file and the notes on it, each after `prefix`."""
    chip = sanitise(calibration.sensor.chip or "a sensor")
    first = f"Calibration of {chip} by mpucal, {date_text(calibration)}; {units}."
    return [f"{prefix}{line}" for line in (first, *notes)]


def date_text(calibration: Calibration) -> str:
    """Return the date of the calibration for a comment."""
    return sanitise(calibration.created) or "undated"


def sanitise(text: str) -> str:
    """Return a name or date that is safe in a comment of any language."""
    return UNSAFE.sub("_", text)


def float_rounding(calibration: Calibration) -> tuple[str, ...]:
    """Return the note for a form whose numbers are float32."""
    return (f"Its numbers are float32: rounding errors are up to {float_error_mps2(calibration):.1g} m/s^2.",)


def float_error_mps2(calibration: Calibration) -> float:
    """Return the error of about ten roundings at full scale [m/s^2]."""
    range_mps2 = (calibration.sensor.accel_range_g or 16.0) * STANDARD_GRAVITY_MPS2
    gain = float(np.abs(calibration.inverse).sum(axis=1).max())
    return 8 * FLOAT_EPS * gain * (range_mps2 + float(np.abs(calibration.b_a).max()))


def scale_of_rates(calibration: Calibration) -> tuple[str, ...]:
    """Return the note for a form that takes rates from other programs, which differ in the scale of a count.

    Source: Adafruit_MPU6050 2.2.8, MPU6050_light 1.2.1 and FastIMU 1.2.9, compiled; the first two have the data sheet's
    sensitivities as it prints them, with one decimal.
    """
    range_dps = calibration.sensor.gyro_range_dps
    if calibration.sensor.who_am_i not in PARTS or range_dps not in GYRO_RANGES_DPS:
        return ()
    lsb_per_dps = GYRO_COUNTS / range_dps
    others = {
        "those of Adafruit_MPU6050 and MPU6050_light": round(lsb_per_dps, 1),
        "those of FastIMU": 32768 / range_dps,
    }
    factors = [f"{name} by {lsb / lsb_per_dps:.7g}" for name, lsb in others.items() if lsb != lsb_per_dps]
    return (
        f"Rates must be at the data sheet's {lsb_per_dps:g} LSB/(deg/s): multiply {', '.join(factors)}, and those of"
        f" another library by its raw count / (its rate in deg/s * {lsb_per_dps:g}).",
    )


def without_gyroscope(calibration: Calibration) -> tuple[str, ...]:
    """Return the note for a form that corrects only the accelerometer."""
    known = np.isfinite(calibration.b_omega).all()
    bias = f"{np.degrees(np.abs(calibration.b_omega).max()):.2f} deg/s" if known else "its bias"
    scale = 100.0 * float(np.abs(calibration.K - np.eye(3)).max())
    scaled = f" and up to {scale:.2f} % of a rate" if scale else ""
    return (f"It does not correct the gyroscope: {bias}{scaled} remain.",)


def without_temperature(calibration: Calibration) -> tuple[str, ...]:
    """Return the note for a form that holds b_a at one temperature."""
    if not calibration.follows_temperature:
        return ()
    worst = float(np.abs(calibration.b_a_slope).max())
    at = calibration.sensor.temperature_c
    return (f"It holds b_a at {at:.1f} deg C: the error is up to {worst:.2g} m/s^2 per degree away from that.",)


def optional_temperature(calibration: Calibration) -> tuple[str, ...]:
    """Return the note for a form that compensates the temperature only if the caller passes it."""
    if not calibration.follows_temperature:
        return ()
    return (f"Without the temperature as an argument: {without_temperature(calibration)[0]}",)


def hardware_offsets(calibration: Calibration) -> tuple[str, ...]:
    """Return the note for a calibration of which the chip's registers subtract a part."""
    applied = calibration.applied_in_hardware
    if not np.any(applied):
        return ()
    return (
        f"It leaves out the ({format_xyz(applied)}) m/s^2 that the chip's offset registers subtract already; after a"
        " reset of the chip they do not, which leaves an error of that size.",
    )


def temperature_range(c: Calibration) -> tuple[float, float, float]:
    """Return the temperature of b_a and the range of b_a(T) [deg C]; zeros if b_a(T) is not known."""
    if not c.follows_temperature or c.sensor.temperature_c is None:
        return 0.0, 0.0, 0.0
    start, end = c.temperature_range_c.tolist()
    return c.sensor.temperature_c, start, end


def format_xyz(values: Vector) -> str:
    """Return the three numbers as text."""
    return ", ".join(f"{value:+.4f}" for value in values)
