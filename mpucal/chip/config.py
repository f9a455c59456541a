"""User's choice of range, rate and filter, checked against what chips have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import ChipError, UsageError
from . import registers as reg
from .families import Part
from .settings import Settings

# Some chips corrupt frames if more than 24 to 32 are queued; with the usual periods, 20 are. A simulation at full speed
# polls less often: it may fill this share of its FIFO, or queue this number of frames of a FIFO of 1024 bytes.
MOST_FILLED, MAX_FRAMES_A_POLL = 0.75, 54
MIN_POLL_S = 0.001
SLOW_POLL_S = 0.040
FAST_POLL_S, FAST_HZ = 0.020, 400
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
        longest_s = MAX_FRAMES_A_POLL / self.rate_hz
        if not MIN_POLL_S <= self.period_s <= longest_s:
            raise UsageError(
                f"the FIFO cannot be polled every {self.period_s:g} s at {self.rate_hz:g} Hz",
                f"poll every {MIN_POLL_S:g} to {longest_s:g} s",
            )

    @property
    def period_s(self) -> float:
        """Time between two polls of the FIFO: the longest that a FIFO of 512 bytes and a host 10 ms late allow."""
        if self.poll_s is not None:
            return self.poll_s
        return FAST_POLL_S if self.rate_hz > FAST_HZ else SLOW_POLL_S

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
