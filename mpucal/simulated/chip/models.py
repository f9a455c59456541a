"""The chips that can be simulated: a family, and what this one of it is like when it is switched on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...chip import registers as reg
from ...chip.families import CLONE98, MPU6050, MPU6500, MPU6880, Family
from .factory import Factory

AWAKE = 0x01


@dataclass(frozen=True)
class Model:
    """One kind of chip.

    Attributes
    ----------
    name : as in an option. family : its register map.
    who_am_i : its identity. power_on : PWR_MGMT_1 after a reset.
    accel_sensitivity : counts a g, over the nominal; revision C of the 6050 has half.
    offset_lsb_per_g : what one count of an accelerometer offset really does.
    offsets_kept : its accelerometer offsets can be written.
    reset_needs_fifo_off : FIFO_RST works only while FIFO_EN is 0 (RM-MPU-6000A, register 106).
    fifo_size_bits : ACCEL_CONFIG2 [7:6] doubles the FIFO that many times.
    """

    name: str
    family: Family
    who_am_i: int
    power_on: int
    accel_sensitivity: float = 1.0
    offset_lsb_per_g: float = 2048.0
    offsets_kept: bool = True
    reset_needs_fifo_off: bool = False
    fifo_size_bits: bool = False

    def writable(self) -> frozenset[int]:
        """The addresses that keep what is written to them."""
        offsets = {address + i for address in self.family.accel_offset_h for i in (0, 1) if self.offsets_kept}
        own = {reg.ACCEL_CONFIG2} if self.family.has_accel_config2 else set()
        return frozenset(WRITABLE | offsets | own)

    def reset_values(self, factory: Factory) -> bytearray:
        """All 128 registers after a reset, with what the factory left in this piece."""
        values = bytearray(128)
        values[reg.PWR_MGMT_1] = self.power_on
        values[reg.WHO_AM_I] = self.who_am_i
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

# How the accelerometer's offset registers of a simulated chip answer, by the word of an option.
OFFSETS: dict[str, dict[str, Any]] = {
    "2048": {},
    "4096": {"offset_lsb_per_g": 4096.0},
    "readonly": {"offsets_kept": False},
}

MODELS = {
    model.name: model
    for model in (
        Model("mpu6050", MPU6050, 0x68, reg.PWR_MGMT_1_SLEEP, reset_needs_fifo_off=True),
        Model("mpu6050c", MPU6050, 0x68, reg.PWR_MGMT_1_SLEEP, accel_sensitivity=0.5, reset_needs_fifo_off=True),
        Model("mpu6500", MPU6500, 0x70, AWAKE),
        Model("mpu6880", MPU6880, 0x78, AWAKE),
        Model("clone98", CLONE98, 0x98, reg.PWR_MGMT_1_SLEEP, fifo_size_bits=True),
    )
}
