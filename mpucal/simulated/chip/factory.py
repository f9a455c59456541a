"""Factory settings of one piece of a chip: its trims and self-test codes.

Source: RM-MPU-6000A r4.2 registers 13 to 16; for the 6500, RM-MPU-9250A r1.4 registers 0 to 15, whose code c
means 2620 * 1.01^(c - 1) counts at the smallest full scale (also in Linux' drivers/iio/imu/inv_mpu6050).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...chip import registers as reg
from ...chip.families import Family
from ...data import Vector

Whole = NDArray[np.int64]
Three = tuple[float, float, float]
Codes = tuple[int, int, int]

# A self-test response is within this share of the code's; data sheets allow 14 %.
SELF_TEST_SPREAD = 0.05


@dataclass(frozen=True)
class FactoryTrim:
    """Factory settings of one piece.

    Attributes
    ----------
    accel_trim : 16-bit words of the accelerometer's offset registers x, y, z after a reset.
    accel_codes, gyro_codes : self-test codes x, y, z; 0: none.
    accel_self_test_g, gyro_self_test_dps : added to each axis while its self test is on.
    """

    accel_trim: Codes = (0, 0, 0)
    accel_codes: Codes = (0, 0, 0)
    gyro_codes: Codes = (0, 0, 0)
    accel_self_test_g: Three = (0.0, 0.0, 0.0)
    gyro_self_test_dps: Three = (0.0, 0.0, 0.0)

    @classmethod
    def draw(cls, rng: np.random.Generator, family: Family) -> Self:
        """Draw a plausible piece: trims within +-1.5 g at 2048 LSB/g, with any reserved bit 0."""
        trim = rng.integers(-3000, 3000, 3)
        of_test = rng.spawn(1)[0]
        low, high = ((10, 25), (8, 25)) if family.packed_self_test else ((85, 125), (130, 170))
        accel_codes, gyro_codes = of_test.integers(*low, 3), of_test.integers(*high, 3)
        spread = 1 + of_test.uniform(-SELF_TEST_SPREAD, SELF_TEST_SPREAD, (2, 3))
        accel_g, gyro_dps = _responses(family, accel_codes, gyro_codes) * spread
        return cls(
            accel_trim=_whole(trim),
            accel_codes=_whole(accel_codes),
            gyro_codes=_whole(gyro_codes),
            accel_self_test_g=_real(accel_g),
            gyro_self_test_dps=_real(gyro_dps),
        )

    def registers(self, family: Family) -> dict[int, int]:
        """Return the settings by register address."""
        values: dict[int, int] = {}
        for address, word in zip(family.accel_offset_h, self.accel_trim, strict=True):
            values |= dict(enumerate(word.to_bytes(2, "big", signed=True), address))
        if family.packed_self_test:
            return values | dict(enumerate(self._packed(), reg.SELF_TEST_ACCEL))
        return (
            values
            | dict(enumerate(self.gyro_codes, reg.SELF_TEST_GYRO))
            | dict(enumerate(self.accel_codes, reg.SELF_TEST_ACCEL))
        )

    def _packed(self) -> list[int]:
        """Return bits 4:2 of each accelerometer code above the gyroscope's; bits 1:0 of all three in the fourth."""
        bytes_ = [(a >> 2) << 5 | g for a, g in zip(self.accel_codes, self.gyro_codes, strict=True)]
        x, y, z = (a & 3 for a in self.accel_codes)
        return [*bytes_, x << 4 | y << 2 | z]


def _responses(family: Family, accel_codes: Whole, gyro_codes: Whole) -> Vector:
    """Return (2, 3) the responses of the codes: g, then deg/s."""
    if family.packed_self_test:
        accel_g = 0.34 * (0.92 / 0.34) ** ((accel_codes - 1) / 30)
        return np.array([accel_g, 25 * 1.046 ** (gyro_codes - 1) * np.array([1, -1, 1])])
    counts = 2620 * 1.01 ** (np.array([accel_codes, gyro_codes]) - 1)
    return np.asarray(counts / np.array([[reg.ACCEL_LSB_PER_G[0]], [reg.GYRO_LSB_PER_DPS[0]]]))


def _whole(values: Whole) -> Codes:
    x, y, z = (int(value) for value in values)
    return x, y, z


def _real(values: Vector) -> Three:
    x, y, z = (float(value) for value in values)
    return x, y, z
