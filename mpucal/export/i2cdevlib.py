"""A calibration as the six offset words of i2cdevlib's MPU6050: setXAccelOffset and the like.

The accelerometer's registers add 1/2048 g a count to what the factory trimmed, with bit 0 reserved; the gyroscope's add
4/131 deg/s a count, whatever the range (register map of the MPU-6500, revision 2.1, XG_OFFS_USR; MPU-6050: the same).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..chip.offsets import shift_words
from ..chip.registers import GYRO_OFFSET_LSB_PER_DPS
from ..data import STANDARD_GRAVITY_MPS2
from ..errors import ChipError, WriteBackError
from ..result.calibration import Calibration
from .losses import head, mps2

LSB_PER_G = 2048.0
WORD = 1 << 15


def text(calibration: Calibration, notes: Sequence[str]) -> str:
    """A function for a sketch, with `notes` in its head.

    Raises
    ------
    WriteBackError : nothing says what the factory's trim was, or a word does not hold an offset.
    """
    a, w = _words(calibration)
    remarks = "\n".join(f"// {line}" for line in (f"{head(calibration)}.", *notes))
    calls = [
        f"    mpu.set{axis}{kind}Offset({word});"
        for kind, of in (("Accel", a), ("Gyro", w))
        for axis, word in _axes(of)
    ]
    return "\n".join([remarks, '#include "MPU6050.h"', "", "void setOffsets(MPU6050 &mpu)", "{", *calls, "}", ""])


def left(calibration: Calibration) -> tuple[str, ...]:
    """What offsets leave."""
    scale = 100.0 * float(np.abs(calibration.D - np.eye(3)).max())
    return (
        f"It holds offsets alone: scale factor errors and misalignments, up to {scale:.2f} % of an acceleration, stay.",
        "Call setOffsets(mpu) after each mpu.initialize() and after a reset of the chip, as its registers are volatile;"
        " their steps of 1 mg and 0.03 deg/s leave half of that.",
        "It assumes that the accelerometer's offset registers count 2048 to 1 g: where they count 4096, as in some"
        " MPU-6050, half of b_a stays. `mpucal doctor` measures which it is, and `mpucal write CALIBRATION chip` writes"
        " by that.",
        f"The accelerometer's registers held {calibration.sensor.accel_offsets}, and the gyroscope's are taken to have"
        f" held 0; all of b_a, ({mps2(calibration.b_a)}) m/s^2, is in the words.",
    )


def _words(calibration: Calibration) -> tuple[tuple[int, int, int], tuple[int, ...]]:
    trim = calibration.sensor.accel_offsets
    if trim is None:
        raise WriteBackError(
            "nothing was exported: the calibration does not say what the accelerometer's offset registers held",
            "calibrate from a capture of the chip",
        )
    try:
        a = shift_words(trim, -calibration.b_a / STANDARD_GRAVITY_MPS2 * LSB_PER_G)
    except ChipError as error:
        raise WriteBackError(f"nothing was exported: {error.what}", error.remedy) from error
    w = np.rint(-np.degrees(np.nan_to_num(calibration.b_omega)) * GYRO_OFFSET_LSB_PER_DPS)
    if np.abs(w).max() >= WORD:
        raise WriteBackError("nothing was exported: no word holds the gyroscope's bias", "check the gyroscope")
    return a, tuple(w.astype(int).tolist())


def _axes(words: Sequence[int]) -> list[tuple[str, int]]:
    return list(zip("XYZ", words, strict=True))
