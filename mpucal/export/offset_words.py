"""A calibration as words for a chip's offset registers: with Linux's IIO, and of i2cdevlib's MPU6050.

For IIO it is sysfs commands, calibbias and calibscale, and the accelerometer's matrix for udev. iio-sensor-proxy
shows M diag(calibscale) (y + offset of calibbias), with M of udev's ACCEL_MOUNT_MATRIX, so that M diag(calibscale) =
inv(D) scale / printed; M has columns of length 1 if there is a calibscale. The driver inv_mpu6050 prints a scale that
is 0.07 to 0.09 % less than the data sheet's, to which D refers. It writes calibbias to the accelerometer's offset
registers and has no calibscale. Its mount matrix, of the device tree, is for all channels (inv_mpu_core.c,
inv_ext_info): inv(D) there would distort the gyroscope's rates. For a chip with the MPU-6500's registers the driver
writes calibbias to wrong addresses, those of the MPU-6050, so it must not be used.

For i2cdevlib it is six words, setXAccelOffset and the like. The accelerometer's registers add 1/2048 g per count to the
factory trim, with bit 0 reserved; the gyroscope's add 4/131 deg/s per count at any range (register map of the MPU-6500,
revision 2.1, XG_OFFS_USR; MPU-6050: the same).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..chip.families import MPU6050, PARTS, part_named
from ..chip.offsets import Words, shift_words
from ..chip.registers import ACCEL_RANGES_G, GYRO_OFFSET_LSB_PER_DPS
from ..data import AXES, STANDARD_GRAVITY_MPS2, Vector
from ..errors import ChipError, WriteBackError
from ..iio.attributes import ACCEL, MPU_SCALES, PRINTED_SCALES
from ..result.calibration import Calibration
from .losses import format_xyz, heading

LSB_PER_G = MPU6050.accel_offset_lsb_per_g


def linux_iio(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return a script for /bin/sh, whose argument is the device's folder, with `notes` in its heading."""
    words, _ = offset_words(calibration)
    data_sheet, printed = _scales(calibration)
    gain = calibration.inverse * (data_sheet / printed)
    scale = np.linalg.norm(gain, axis=0)
    usage = "usage: sh FILE /sys/bus/iio/devices/iio:deviceN"
    lines = ["#!/bin/sh", *heading(calibration, (usage, *notes), "# "), "set -e", _DEVICE, _PUT]
    if words is not None:
        lines += [f'put "$DEVICE/in_accel_{axis}_calibbias" {word}' for axis, word in zip(AXES, words, strict=True)]
    calibscales = " && ".join(f'[ -w "$DEVICE/in_accel_{axis}_calibscale" ]' for axis in AXES)
    lines += [f"if {calibscales}; then"]
    lines += [f'    put "$DEVICE/in_accel_{a}_calibscale" {s:.9f}' for a, s in zip(AXES, scale, strict=True)]
    lines += [f'    MATRIX="{matrix_text(gain / scale)}"', "else", f'    MATRIX="{matrix_text(gain)}"', "fi", _MATRIX]
    return "\n".join(lines) + "\n"


def offset_words(calibration: Calibration) -> tuple[Words | None, str]:
    """Return the words for the offset registers, or None and the reason; absolute, so that writing twice is safe."""
    sensor = calibration.sensor
    part = part_named(sensor.chip)
    if part is None or part.family is not MPU6050:
        return None, "calibbias is not used, as the driver writes to wrong registers of all chips except the MPU-6050"
    if sensor.accel_offsets is None:
        return None, "calibbias is not used, as the calibration lacks the factory trim"
    try:
        return words_without_bias(sensor.accel_offsets, calibration.b_a), ""
    except ChipError as error:
        return None, f"calibbias is not used: {error.what}"


def words_without_bias(trim: Words, b_a: Vector) -> Words:
    """Return the words of offset registers that subtract b_a (3,) m/s^2 besides the factory trim.

    Raises
    ------
    ChipError : one does not fit.
    """
    return shift_words(trim, -b_a / STANDARD_GRAVITY_MPS2 * LSB_PER_G)


def _scales(calibration: Calibration) -> tuple[float, float]:
    """Return the scale of a count by the data sheet, and as inv_mpu6050 prints it; ones for other chips and ranges."""
    sensor = calibration.sensor
    if sensor.who_am_i not in PARTS or sensor.accel_range_g not in ACCEL_RANGES_G:
        return 1.0, 1.0
    code = ACCEL_RANGES_G.index(int(sensor.accel_range_g))
    return MPU_SCALES[ACCEL][code], PRINTED_SCALES[ACCEL][code]


def linux_iio_losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on the errors that remain."""
    _, why = offset_words(calibration)
    data_sheet, printed = _scales(calibration)
    scale: tuple[str, ...] = (_SCALE,)
    if data_sheet != printed:
        shown, less = ", ".join(f"{value:g}" for value in PRINTED_SCALES[ACCEL]), 100 * (1 - printed / data_sheet)
        scale += (
            f"The line assumes the driver inv_mpu6050, which shows an in_accel_scale of {shown}: {less:.2f} % less"
            " than the data sheet's. Where `cat in_accel_scale` shows another one, an error of that size remains.",
        )
    if why:
        return (f"{why}; programs have to subtract b_a, ({format_xyz(calibration.b_a)}) m/s^2.", *scale)
    step = STANDARD_GRAVITY_MPS2 / LSB_PER_G  # half of two counts, as bit 0 is reserved
    return (
        f"calibbias has steps of 1 mg: up to {step:.4f} m/s^2 of b_a remain; where 4096 counts of an offset register"
        " are 1 g, as in some MPU-6050, half of b_a remains (`mpucal write` measures this).",
        "The offset registers are volatile: run the script after each start.",
        *scale,
    )


_SCALE = (
    "The script prints the correction of D as a line for udev, which iio-sensor-proxy applies to the accelerometer"
    " only; without it, and for programs that read the channels themselves, D is not corrected. Do not put it into the"
    " device tree: a mount-matrix of inv_mpu6050 applies to the gyroscope, too."
)
_DEVICE = 'DEVICE="${1:?give the folder of the device}"'
_PUT = """put() { printf '%s' "$2" > "$1"; [ "$(cat "$1")" = "$2" ] || { echo "$1 does not keep $2" >&2; exit 1; }; }"""
_MATRIX = 'echo "udev: ACCEL_MOUNT_MATRIX=$MATRIX"'


def matrix_text(values: Vector) -> str:
    """Return a matrix (3, 3) as text for udev and sysfs."""
    return "; ".join(", ".join(f"{value:.9f}" for value in row) for row in values)


def i2cdevlib(calibration: Calibration, notes: Sequence[str]) -> str:
    """Return a function for a sketch, with `notes` in its heading.

    Raises
    ------
    WriteBackError : the factory trim is not known, or an offset does not fit into a word.
    """
    a, w = _words(calibration)
    calls = [
        f"    mpu.set{axis}{kind}Offset({word});"
        for kind, words in (("Accel", a), ("Gyro", w))
        for axis, word in zip("XYZ", words, strict=True)
    ]
    head = [*heading(calibration, notes, "// "), '#include "MPU6050.h"', "", "void setOffsets(MPU6050 &mpu)", "{"]
    return "\n".join([*head, *calls, "}", ""])


def i2cdevlib_losses(calibration: Calibration) -> tuple[str, ...]:
    """Return notes on the errors that remain with offsets only."""
    scale = 100.0 * float(np.abs(calibration.D - np.eye(3)).max())
    return (
        f"It holds only offsets: scale factor errors and misalignments of up to {scale:.2f} % of |a| remain.",
        "Call setOffsets(mpu) after each mpu.initialize() and after a reset of the chip, as its registers are volatile;"
        " the rounding to steps of 1 mg and 0.03 deg/s leaves half a step.",
        "It assumes that 2048 counts of the accelerometer's offset registers are 1 g: where it is 4096, as in some"
        " MPU-6050, half of b_a remains. `mpucal doctor` measures this, and `mpucal write CALIBRATION chip` takes it"
        " into account.",
        f"The words contain all of b_a, ({format_xyz(calibration.b_a)}) m/s^2: the accelerometer's registers held"
        f" {calibration.sensor.accel_offsets}, and the gyroscope's are assumed to have held 0.",
    )


def _words(calibration: Calibration) -> tuple[Words, tuple[int, ...]]:
    trim = calibration.sensor.accel_offsets
    if trim is None:
        raise WriteBackError(
            "nothing was exported: the calibration lacks the content of the accelerometer's offset registers",
            "calibrate from a capture of the chip",
        )
    try:
        a = words_without_bias(trim, calibration.b_a)
    except ChipError as error:
        raise WriteBackError(f"nothing was exported: {error.what}", error.remedy) from error
    w = np.rint(-np.degrees(np.nan_to_num(calibration.b_omega)) * GYRO_OFFSET_LSB_PER_DPS)
    if np.abs(w).max() > np.iinfo(np.int16).max:
        raise WriteBackError(
            "nothing was exported: the gyroscope's bias does not fit into a word", "check the gyroscope"
        )
    return a, tuple(w.astype(int).tolist())
