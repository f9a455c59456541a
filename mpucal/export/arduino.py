"""A calibration as an Arduino sketch that reads the chip over Wire and prints calibrated accelerations and rates."""

from __future__ import annotations

from collections.abc import Sequence

from ..chip.config import Config
from ..chip.families import MPU6050, family_of
from ..chip.registers import ACCEL_RANGES_G, FULL_SCALE_SHIFT, GYRO_RANGES_DPS
from ..data import ACCEL_COUNTS, GYRO_COUNTS
from ..result.calibration import Calibration
from .c_code import c_functions
from .losses import heading
from .templates import fill

# values of the registers by the range
ACCEL_CONFIG = {float(g): code << FULL_SCALE_SHIFT for code, g in enumerate(ACCEL_RANGES_G)}
GYRO_CONFIG = {float(dps): code << FULL_SCALE_SHIFT for code, dps in enumerate(GYRO_RANGES_DPS)}


def text(calibration: Calibration, notes: Sequence[str]) -> str:
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


def losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on assumptions of the sketch."""
    sensor, notes = calibration.sensor, ["It reads the chip at address 0x68: if AD0 is high, change CHIP to 0x69."]
    if sensor.accel_range_g not in ACCEL_CONFIG:
        notes.append(f"It sets +-{Config.accel_range_g:g} g, but the calibration is of another or unknown range.")
    if sensor.gyro_range_dps not in GYRO_CONFIG:
        notes.append(f"It sets +-{Config.gyro_range_dps:g} deg/s, but the calibration is of another or unknown range.")
    if family_of(sensor.chip) is None and calibration.follows_temperature:
        notes.append("It assumes the thermometer of an MPU-6050; `mpucal doctor` shows which chip it is.")
    return tuple(notes)
