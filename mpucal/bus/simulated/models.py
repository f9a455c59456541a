"""The chips that can be simulated: a family, and what this one of it is like when it is switched on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...chip import registers as reg
from ...chip.families import CLONE98, MPU6050, MPU6500, Family

AWAKE = 0x01


@dataclass(frozen=True)
class Model:
    """One kind of chip.

    Attributes
    ----------
    name : as in an option. family : its register map.
    who_am_i : its identity. power_on : PWR_MGMT_1 after a reset.
    reset_needs_fifo_off : FIFO_RST works only while FIFO_EN is 0 (RM-MPU-6000A, register 106).
    fifo_size_bits : ACCEL_CONFIG2 [7:6] doubles the FIFO that many times.
    """

    name: str
    family: Family
    who_am_i: int
    power_on: int
    reset_needs_fifo_off: bool = False
    fifo_size_bits: bool = False

    def writable(self) -> frozenset[int]:
        """The addresses that keep what is written to them."""
        offsets = {address + i for address in self.family.accel_offset_h for i in (0, 1)}
        own = {reg.ACCEL_CONFIG2} if self.family.has_accel_config2 else set()
        return frozenset(WRITABLE | offsets | own)

    def reset_values(self, accel_trim: tuple[int, int, int]) -> bytearray:
        """All 128 registers after a reset, with the factory's `accel_trim` (16-bit words x, y, z)."""
        values = bytearray(128)
        values[reg.PWR_MGMT_1] = self.power_on
        values[reg.WHO_AM_I] = self.who_am_i
        for address, word in zip(self.family.accel_offset_h, accel_trim, strict=True):
            values[address : address + 2] = word.to_bytes(2, "big", signed=True)
        return values


def draw_accel_trim(rng: np.random.Generator) -> tuple[int, int, int]:
    """A factory trim: within +-1.5 g at 2048 LSB/g, with any reserved bit 0."""
    x, y, z = (int(word) for word in rng.integers(-3000, 3000, 3))
    return x, y, z


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

MODELS = {
    model.name: model
    for model in (
        Model("mpu6050", MPU6050, 0x68, reg.PWR_MGMT_1_SLEEP, reset_needs_fifo_off=True),
        Model("mpu6500", MPU6500, 0x70, AWAKE),
        Model("clone98", CLONE98, 0x98, reg.PWR_MGMT_1_SLEEP, fifo_size_bits=True),
    )
}
