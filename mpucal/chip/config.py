"""What a person may choose of how a chip measures, checked against what chips have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import ChipError, UsageError
from . import registers as reg
from .families import Part
from .settings import Settings

# Beyond 24 to 32 queued frames chips are known to corrupt some.
MAX_FRAMES_A_POLL = 24
MIN_POLL_S = 0.001
SLOW_POLL_S = 0.040
FAST_POLL_S, FAST_HZ = 0.020, 400
ALONE_POLL_S = 0.005
# read one by one, samples take the bus half the time at this rate and 400 kHz, and all of it at a quarter of that
MOST_POLLED_HZ = 250


@dataclass(frozen=True)
class Config:
    """How the chip is to measure.

    Attributes
    ----------
    accel_range_g : 2, 4, 8 or 16. gyro_range_dps : 250, 500, 1000 or 2000 deg/s.
    rate_hz : samples a second, nominally; at ACCEL_ONLY_HZ of the accelerometer alone, and past its filter.
    dlpf : code of the low-pass filter, 0 (widest) to 6.
    poll_s : time between two looks into the FIFO; None: `period_s` as suits the rate.

    Raises
    ------
    UsageError : a value that the chip does not have; the sentence names those that it has.
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
        if not self.accel_only:
            reg.sample_rate_divider(self.rate_hz, self.dlpf)
        longest_s = MAX_FRAMES_A_POLL / self.rate_hz
        if not MIN_POLL_S <= self.period_s <= longest_s:
            raise UsageError(
                f"the FIFO cannot be polled every {self.period_s:g} s at {self.rate_hz:g} Hz",
                f"poll every {MIN_POLL_S:g} to {longest_s:g} s",
            )

    @property
    def period_s(self) -> float:
        """Time between two looks into the FIFO: as seldom as a FIFO of 512 bytes and a host 10 ms late allow."""
        if self.poll_s is not None:
            return self.poll_s
        return ALONE_POLL_S if self.accel_only else FAST_POLL_S if self.rate_hz > FAST_HZ else SLOW_POLL_S

    @property
    def accel_only(self) -> bool:
        """Whether the gyroscope is left out."""
        return self.rate_hz == reg.ACCEL_ONLY_HZ

    def settings(self, part: Part) -> Settings:
        """The same for one part; one with less sensitivity takes the smallest range that is large enough.

        Raises
        ------
        ChipError : the part has no such rate.
        """
        self._check_part(part)
        range_g = min(self.accel_range_g * part.accel_sensitivity, reg.ACCEL_RANGES_G[-1])
        return Settings(
            part=part,
            smplrt_div=0
            if self.accel_only or not part.fifo_bytes
            else reg.sample_rate_divider(self.rate_hz, self.dlpf),
            dlpf_cfg=self.dlpf,
            fs_sel=reg.GYRO_RANGES_DPS.index(self.gyro_range_dps),
            afs_sel=next(i for i, nominal_g in enumerate(reg.ACCEL_RANGES_G) if nominal_g >= range_g),
            accel_only=self.accel_only,
        )

    def _check_part(self, part: Part) -> None:
        if not part.fifo_bytes and self.rate_hz > MOST_POLLED_HZ:
            what = f"this {part.chip} has no FIFO, so that each sample is read by itself"
            raise ChipError(what, f"take --rate {MOST_POLLED_HZ} or less")
        filtered_apart = part.family.has_accel_config2
        if self.accel_only and not filtered_apart:
            raise ChipError(
                f"the accelerometer of the {part.chip} measures {reg.MAX_RATE_HZ:g} times a second at most",
                f"take --rate {reg.MAX_RATE_HZ:g} or less; only the MPU-6500's family is faster",
            )
        # RM-MPU-9250A, register 25: SMPLRT_DIV divides what was filtered, and that is the case for 1 to 6
        if filtered_apart and not self.accel_only and reg.base_rate_hz(self.dlpf) > reg.MAX_RATE_HZ:
            what = f"the {part.chip} takes 8000 samples a second with its filter at {self.dlpf}"
            raise ChipError(what, "take 1 to 6")


class RateOnlyConfig(Config):
    """Of a source that is no chip of ours: what is asked for is a rate, and what comes is its answer.

    Raises
    ------
    UsageError : a rate that is none.
    """

    def __post_init__(self) -> None:
        if not 1 <= self.rate_hz <= reg.MAX_RATE_HZ:
            raise UsageError(f"{self.rate_hz:g} Hz is no rate to ask for", f"take 1 to {reg.MAX_RATE_HZ:g} Hz")

    @property
    def accel_only(self) -> bool:
        """Never."""
        return False


def _check(what: str, value: float, unit: str, allowed: Sequence[int]) -> None:
    if value not in allowed:
        choices = ", ".join(str(choice) for choice in allowed)
        raise UsageError(
            f"the chip has no {what} of {value:g} {unit}".rstrip(), f"take one of {choices} {unit}".rstrip()
        )
