"""Settings of a chip that measures, converted to register values and back.

Source: RM-MPU-6000A r4.2 registers 25 to 28, RM-MPU-9250A r1.4 register 29.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from ..data import Sensor
from ..errors import RecordingError
from . import registers as reg
from .families import Part


@dataclass(frozen=True)
class Settings:
    """Settings on which the meaning of a FIFO frame depends.

    Attributes
    ----------
    part : the chip. smplrt_div, dlpf_cfg : sample rate and low-pass filter, as registers hold them.
    fs_sel, afs_sel : full scale of gyroscope and accelerometer, 0..3.
    """

    part: Part
    smplrt_div: int
    dlpf_cfg: int
    fs_sel: int
    afs_sel: int

    @property
    def polled(self) -> bool:
        """True if the chip has no FIFO: the newest sample is read each time."""
        return not self.part.fifo_bytes

    @property
    def nominal_rate_hz(self) -> float:
        """Sample rate of a chip whose clock is exact; real ones are up to 1 % off."""
        return reg.sample_rate_hz(self.smplrt_div, self.dlpf_cfg)

    @property
    def mps2_per_lsb(self) -> float:
        """Acceleration [m/s^2] of one count."""
        return reg.mps2_per_lsb(self.afs_sel) / self.part.accel_sensitivity

    @property
    def sensor(self) -> Sensor:
        """Sensor as far as it is known before it has measured."""
        return Sensor(
            chip=self.part.chip,
            who_am_i=self.part.who_am_i,
            accel_range_g=reg.ACCEL_RANGES_G[self.afs_sel] / self.part.accel_sensitivity,
            gyro_range_dps=float(reg.GYRO_RANGES_DPS[self.fs_sel]),
            rate_hz=self.nominal_rate_hz,
            accel_lag_s=self.part.family.accel_lag_s(self.dlpf_cfg),
        )

    def registers(self) -> dict[int, int]:
        """Return the value of each register, in the order of writing."""
        values = {
            reg.PWR_MGMT_2: 0,
            # It also shows a reset of the chip, which clears it.
            reg.INT_ENABLE: reg.INT_FIFO_OFLOW,
            reg.SMPLRT_DIV: self.smplrt_div,
            reg.CONFIG: self.dlpf_cfg,
            reg.GYRO_CONFIG: self.fs_sel << self.part.family.gyro_range_shift,
            reg.ACCEL_CONFIG: self.afs_sel << reg.FULL_SCALE_SHIFT,
        }
        if self.part.family.has_accel_config2:
            size = reg.FIFO_SIZE if self.part.wide_fifo_bytes else 0
            values[reg.ACCEL_CONFIG2] = size | self.dlpf_cfg
        return values

    @classmethod
    def from_registers(cls, held: Mapping[int, int], part: Part, name: str = "the capture") -> Self:
        """Return the settings of `part` from `held`: values by register address.

        Raises
        ------
        RecordingError : a register that is needed is missing.
        """
        needed = (reg.SMPLRT_DIV, reg.CONFIG, reg.GYRO_CONFIG, reg.ACCEL_CONFIG)
        missing = [f"0x{register:02x}" for register in needed if register not in held]
        if missing:
            raise RecordingError(
                f"{name} does not say what register {', '.join(missing)} held as the FIFO started",
                "record again from the start of the chip",
            )
        return cls(
            part=part,
            smplrt_div=held[reg.SMPLRT_DIV],
            dlpf_cfg=held[reg.CONFIG] & reg.CONFIG_DLPF_CFG,
            fs_sel=held[reg.GYRO_CONFIG] >> part.family.gyro_range_shift & reg.FULL_SCALE_CODES,
            afs_sel=held[reg.ACCEL_CONFIG] >> reg.FULL_SCALE_SHIFT & reg.FULL_SCALE_CODES,
        )
