"""User's choice of range, rate and filter, checked against what chips have; and the settings of registers it leads to.

Source: RM-MPU-6000A r4.2 registers 25 to 28, RM-MPU-9250A r1.4 register 29.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

from ..data import Sensor
from ..errors import ChipError, RecordingError, UsageError
from . import registers as reg
from .families import MPU6050, Part


class Settings(NamedTuple):
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


# Some chips corrupt frames if more than 24 to 32 are queued; with the usual periods, 20 are. A simulation at full speed
# polls less often: it may fill this share of its FIFO.
MOST_FILLED = 0.75
MIN_POLL_S = 0.001
# Samples read one by one take half of the bus's time at this rate and 400 kHz, and all of it at 100 kHz.
MOST_POLLED_HZ = 250


@dataclass(frozen=True)
class Config:
    """Configuration of the measurement.

    Attributes
    ----------
    accel_range_g : 2, 4, 8 or 16. gyro_range_dps : 250, 500, 1000 or 2000 deg/s.
    rate_hz : nominal sample rate.
    dlpf : code of the low-pass filter, 0 (widest) to 6.
    poll_s : time between two polls of the FIFO; None: `period_s` chooses by the rate.

    Raises
    ------
    UsageError : no chip has this value; the message names those that it has.
    """

    accel_range_g: int = 4
    gyro_range_dps: int = 500
    rate_hz: float = 200
    dlpf: int = 3
    poll_s: float | None = None

    def __post_init__(self) -> None:
        _check("accelerometer range", self.accel_range_g, "g", reg.ACCEL_RANGES_G)
        _check("gyroscope range", self.gyro_range_dps, "deg/s", reg.GYRO_RANGES_DPS)
        _check("low-pass filter", self.dlpf, "", reg.DLPF_CODES)
        reg.sample_rate_divider(self.rate_hz, self.dlpf)
        if not MIN_POLL_S <= self.period_s <= self.longest_s:
            raise UsageError(
                f"the FIFO cannot be polled every {self.period_s:g} s at {self.rate_hz:g} Hz",
                f"poll every {MIN_POLL_S:g} to {self.longest_s:g} s",
            )

    @property
    def period_s(self) -> float:
        """Time between two polls of the FIFO: the longest that a FIFO of 512 bytes and a host 10 ms late allow."""
        if self.poll_s is not None:
            return self.poll_s
        return 0.020 if self.rate_hz > 400 else 0.040

    @property
    def longest_s(self) -> float:
        """Longest time between two polls that the largest FIFO of the usual chips allows."""
        return MOST_FILLED * MPU6050.fifo_bytes // reg.FRAME_BYTES / self.rate_hz

    def settings(self, part: Part) -> Settings:
        """Return the settings for one part; one with less sensitivity gets the smallest range that is large enough.

        Raises
        ------
        ChipError : the part does not have this rate.
        """
        self._check_part(part)
        range_g = min(self.accel_range_g * part.accel_sensitivity, reg.ACCEL_RANGES_G[-1])
        return Settings(
            part=part,
            smplrt_div=reg.sample_rate_divider(self.rate_hz, self.dlpf) if part.fifo_bytes else 0,
            dlpf_cfg=self.dlpf,
            fs_sel=reg.GYRO_RANGES_DPS.index(self.gyro_range_dps),
            afs_sel=next(i for i, nominal_g in enumerate(reg.ACCEL_RANGES_G) if nominal_g >= range_g),
        )

    def _check_part(self, part: Part) -> None:
        if not part.fifo_bytes and self.rate_hz > MOST_POLLED_HZ:
            what = f"this {part.chip} has no FIFO, and its samples are read one by one"
            raise ChipError(what, f"use --rate {MOST_POLLED_HZ} or less")
        # RM-MPU-9250A, register 25: SMPLRT_DIV divides the rate only if the filter is at 1 to 6.
        if part.family.has_accel_config2 and reg.base_rate_hz(self.dlpf) > reg.MAX_RATE_HZ:
            what = f"the {part.chip} takes 8000 samples a second with its filter at {self.dlpf}"
            raise ChipError(what, "set the filter to 1 to 6")


class RateOnlyConfig(Config):
    """Configuration of a source that is not a chip on a bus: it is asked for a rate, and chooses the rest.

    Raises
    ------
    UsageError : an impossible rate.
    """

    def __post_init__(self) -> None:
        if not 1 <= self.rate_hz <= reg.MAX_RATE_HZ:
            raise UsageError(f"a rate of {self.rate_hz:g} Hz is not possible", f"use 1 to {reg.MAX_RATE_HZ:g} Hz")


def _check(what: str, value: float, unit: str, allowed: Sequence[int]) -> None:
    if value not in allowed:
        choices = ", ".join(str(choice) for choice in allowed)
        raise UsageError(
            f"the chip has no {what} of {value:g} {unit}".rstrip(), f"use one of {choices} {unit}".rstrip()
        )
