"""A calibration as sysfs commands for Linux's IIO, calibbias and calibscale, and the accelerometer's matrix for udev.

iio-sensor-proxy shows M diag(calibscale) (y + what calibbias adds), M of udev's ACCEL_MOUNT_MATRIX: M diag(calibscale)
= inv(D), with columns of length 1 in M where there is a calibscale. The driver inv_mpu6050 passes calibbias on to the
accelerometer's offset registers and has no calibscale. Its mount matrix, of the device tree, is one for all channels
(inv_mpu_core.c, inv_ext_info): inv(D) there would distort the gyroscope's rates. Of a chip with the MPU-6500's
registers it writes calibbias to wrong addresses (it takes them to lie as the MPU-6050's do), so that nothing may be
written there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..chip.families import MPU6050, PARTS
from ..chip.offsets import shift_words
from ..data import STANDARD_GRAVITY_MPS2, Vector
from ..errors import ChipError
from ..result.calibration import Calibration
from .losses import head, mps2

AXES = "xyz"
LSB_PER_G = 2048.0
STEP_G = 2 / LSB_PER_G


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """A script for /bin/sh, whose argument is the device's folder, with `notes` in its head."""
    words, _ = offset_words(calibration)
    gain = calibration.inverse
    scale = np.linalg.norm(gain, axis=0)
    remarks = [f"# {line}" for line in (f"{head(calibration)}.", "usage: sh FILE /sys/bus/iio/devices/iio:deviceN")]
    remarks += [f"# {note}" for note in notes]
    lines = ["#!/bin/sh", *remarks, "set -e", _DEVICE, _PUT]
    if words is not None:
        lines += [f'put "$DEVICE/in_accel_{axis}_calibbias" {word}' for axis, word in zip(AXES, words, strict=True)]
    calibscales = " && ".join(f'[ -w "$DEVICE/in_accel_{axis}_calibscale" ]' for axis in AXES)
    lines += [f"if {calibscales}; then"]
    lines += [f'    put "$DEVICE/in_accel_{a}_calibscale" {s:.9f}' for a, s in zip(AXES, scale, strict=True)]
    lines += [f'    MATRIX="{matrix_text(gain / scale)}"', "else", f'    MATRIX="{matrix_text(gain)}"', "fi", _MATRIX]
    return "\n".join(lines) + "\n"


def offset_words(calibration: Calibration) -> tuple[tuple[int, int, int] | None, str]:
    """What the offset registers should hold, or why nobody can say; absolute, so that running it twice does no harm."""
    sensor = calibration.sensor
    families = {part.family for part in PARTS.values() if part.chip == sensor.chip}
    if families != {MPU6050}:
        return None, "calibbias is left alone, as the driver writes to wrong registers of all but an MPU-6050"
    if sensor.accel_offsets is None:
        return None, "calibbias is left alone, as the calibration does not say what the factory's trim was"
    try:
        return shift_words(sensor.accel_offsets, -calibration.b_a / STANDARD_GRAVITY_MPS2 * LSB_PER_G), ""
    except ChipError as error:
        return None, f"calibbias is left alone: {error.what}"


def left(calibration: Calibration) -> tuple[str, ...]:
    """What error the commands leave, a sentence each."""
    _, why = offset_words(calibration)
    if why:
        return (f"It {why}: b_a, ({mps2(calibration.b_a)}) m/s^2, stays to be subtracted by who reads.", _SCALE)
    step = STEP_G * STANDARD_GRAVITY_MPS2 / 2
    return (
        f"calibbias has steps of 1 mg: up to {step:.4f} m/s^2 of b_a stay; where an offset register counts 4096 to 1 g,"
        " as in some MPU-6050, half of b_a stays (`mpucal write` measures which it is).",
        "The offset registers are volatile: run it after each start.",
        _SCALE,
    )


_SCALE = (
    "The script prints the correction of D as a line for udev, which iio-sensor-proxy applies to the accelerometer"
    " alone; until that is there, and for programs that read the channels themselves, D is not corrected. It does not"
    " belong into the device tree: a mount-matrix of inv_mpu6050 is the gyroscope's, too."
)
_DEVICE = 'DEVICE="${1:?give the folder of the device}"'
_PUT = """put() { printf '%s' "$2" > "$1"; [ "$(cat "$1")" = "$2" ] || { echo "$1 does not keep $2" >&2; exit 1; }; }"""
_MATRIX = 'echo "udev: ACCEL_MOUNT_MATRIX=$MATRIX"'


def matrix_text(values: Vector) -> str:
    """(3, 3) as udev and sysfs have it."""
    return "; ".join(", ".join(f"{value:.9f}" for value in row) for row in values)
