"""Chips that can be simulated: families of the table of chips, and the deviations of single parts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...chip import registers as reg
from ...chip.families import ICM20602, ICM20689, ICM20690, MPU6050, MPU6500, MPU6880, MPU6886, Family
from .factory import FactoryTrim

AWAKE = 0x01


@dataclass(frozen=True)
class Model:
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
        values[reg.PWR_MGMT_1] = reg.PWR_MGMT_1_SLEEP if self.family.asleep else AWAKE
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
        replace(_MPU6050, name="mpu6050c", accel_sensitivity=0.5),
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
