"""A calibration as the six offset words of i2cdevlib's MPU6050: setXAccelOffset and the like.

The accelerometer's registers add 1/2048 g per count to the factory trim, with bit 0 reserved; the gyroscope's add
4/131 deg/s per count at any range (register map of the MPU-6500, revision 2.1, XG_OFFS_USR; MPU-6050: the same).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..chip.offsets import Words
from ..chip.registers import GYRO_OFFSET_LSB_PER_DPS
from ..errors import ChipError, WriteBackError
from ..result.calibration import Calibration
from .linux_iio import words_without_bias
from .losses import format_xyz, heading


def text(calibration: Calibration, notes: Sequence[str]) -> str:
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


def losses(calibration: Calibration) -> tuple[str, ...]:
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
