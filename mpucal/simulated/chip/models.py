"""Chips that can be simulated: families of the table of chips, deviations of single parts, and factory settings.

Source: RM-MPU-6000A r4.2 registers 13 to 16; for the 6500, RM-MPU-9250A r1.4 registers 0 to 15, whose code c
means 2620 * 1.01^(c - 1) counts at the smallest full scale (also in Linux' drivers/iio/imu/inv_mpu6050).
"""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np

from ...chip import registers as reg
from ...chip.families import ICM20602, ICM20689, ICM20690, MPU6050, MPU6500, MPU6880, MPU6886, Family
from ...chip.quick_measure import factory_response

Three = tuple[float, ...]
Codes = tuple[int, ...]


class FactoryTrim(NamedTuple):
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
        # the responses are within 5 % of the codes'; data sheets allow 14 %
        spread = 1 + of_test.uniform(-0.05, 0.05, (2, 3))
        accel_g, gyro_dps = np.array(factory_response(family.packed_self_test, accel_codes, gyro_codes)) * spread
        return cls(
            accel_trim=tuple(trim.tolist()),
            accel_codes=tuple(accel_codes.tolist()),
            gyro_codes=tuple(gyro_codes.tolist()),
            accel_self_test_g=tuple(accel_g.tolist()),
            gyro_self_test_dps=tuple(gyro_dps.tolist()),
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


class Model(NamedTuple):
    """Kind of chip; without deviations it is the first part of its family.

    Attributes
    ----------
    name : as in an option. family : its row.
    who_am_i : identity, if not the first part's.
    accel_sensitivity : counts a g, relative to the nominal.
    offset_lsb_per_g : scale of its accelerometer offsets, if not the nominal.
    offsets_kept : its accelerometer offsets can be written. fifo_grows : FIFO_SIZE has the effect of its row.
    """

    name: str
    family: Family
    who_am_i: int | None = None
    accel_sensitivity: float = 1.0
    offset_lsb_per_g: float | None = None
    offsets_kept: bool = True
    fifo_grows: bool = True

    @property
    def identity(self) -> int:
        """Value of WHO_AM_I."""
        return self.family.parts[0][0] if self.who_am_i is None else self.who_am_i

    @property
    def offset_scale(self) -> float:
        """LSB/g of the accelerometer offsets."""
        return self.offset_lsb_per_g or self.family.accel_offset_lsb_per_g

    def writable(self) -> frozenset[int]:
        """Return the addresses that can be written."""
        offsets = {address + i for address in self.family.accel_offset_h for i in (0, 1) if self.offsets_kept}
        own = {reg.ACCEL_CONFIG2} if self.family.has_accel_config2 else set()
        return frozenset(WRITABLE | offsets | own)

    def fifo_bytes(self, accel_config2: int) -> int:
        """Return the size of the FIFO by ACCEL_CONFIG2; each step of FIFO_SIZE doubles it."""
        steps = (accel_config2 & reg.FIFO_SIZE) >> reg.FIFO_SIZE_SHIFT
        widest = self.family.widest_fifo_bytes if self.fifo_grows else None
        return min(self.family.fifo_bytes << steps, widest or self.family.fifo_bytes)

    def reset_values(self, factory: FactoryTrim) -> bytearray:
        """Return all 128 registers after a reset, with the factory settings of this piece."""
        values = bytearray(128)
        values[reg.PWR_MGMT_1] = reg.PWR_MGMT_1_SLEEP if self.family.asleep else 0x01
        values[reg.WHO_AM_I] = self.identity
        for address, value in factory.registers(self.family).items():
            values[address] = value
        return values


WRITABLE = frozenset(
    (
        *range(reg.XG_OFFSET_H, reg.XG_OFFSET_H + 6),
        reg.SMPLRT_DIV,
        reg.CONFIG,
        reg.GYRO_CONFIG,
        reg.ACCEL_CONFIG,
        reg.FIFO_EN,
        reg.INT_PIN_CFG,
        reg.INT_ENABLE,
        reg.SIGNAL_PATH_RESET,
        reg.USER_CTRL,
        reg.PWR_MGMT_1,
        reg.PWR_MGMT_2,
    )
)

# Behaviour of a simulated chip's accelerometer offset registers, by the name in an option.
OFFSETS: dict[str, dict[str, Any]] = {
    "2048": {},
    "4096": {"offset_lsb_per_g": 4096.0},
    "readonly": {"offsets_kept": False},
}

_MPU6050 = Model("mpu6050", MPU6050)
MODELS = {
    model.name: model
    for model in (
        _MPU6050,
        _MPU6050._replace(name="mpu6050c", accel_sensitivity=0.5),
        Model("mpu6500", MPU6500),
        Model("mpu6500_512", MPU6500, fifo_grows=False),
        Model("mpu9250", MPU6500, who_am_i=0x71),
        Model("mpu6880", MPU6880),
        Model("clone98", ICM20689),
        Model("icm20609", ICM20689, who_am_i=0xA6),
        Model("icm20690", ICM20690),
        Model("icm20602", ICM20602),
        Model("mpu6886", MPU6886),
    )
}
