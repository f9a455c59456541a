"""Which part a chip is, from what it answered and how it behaved; makes no access itself.

Clones answer WHO_AM_I as they like. What they cannot disguise is how many bytes their FIFO holds: 1024 in a 6050, 512
in a 6500 (PS-MPU-6000A r3.4 section 1.2, PS-MPU-9250A r1.0 section 1.3), and whether that grows where FIFO_SIZE of
ACCEL_CONFIG2 asks for it; which bits of FIFO_EN it keeps; whether it sleeps after a reset; and that an accelerometer at
rest shows 1 g, or half of it in revision C. Where several parts behave alike, as an MPU-6500 and an ICM-20689 do, what
the chip answers decides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from ..data import Sensor
from ..errors import ChipError
from . import registers as reg
from .families import FIFO_SLACK_BYTES, PARTS, Family, Part, families_with_fifo, part_of

# magnitudes [g] that a board in somebody's hand shows, at half the sensitivity
HALF_G = (0.35, 0.65)
HALF = 0.5


class Behaviour:
    """What a chip's replies say about it, from its identity on until it starts to measure."""

    def __init__(self) -> None:
        self._shown_bytes = 0
        self._fifo_bytes: dict[bool, int] = {}
        self._magnitudes_g: list[float] = []
        self._fifo_en: int | None = None
        self._was_reset = False
        self._asleep: bool | None = None

    def reset(self) -> None:
        """The chip was reset."""
        self._was_reset = True

    def observe(self, register: int, data: bytes, held: Mapping[int, int]) -> None:
        """`data` was read from `register` on, while the registers were known to hold `held`."""
        if register == reg.FIFO_COUNT_H and (held.get(reg.FIFO_EN) or held.get(reg.USER_CTRL)):
            shown, before = int.from_bytes(data, "big"), self._shown_bytes
            self._shown_bytes = shown
            if shown == before:
                self._fifo_bytes[bool(held.get(reg.ACCEL_CONFIG2, 0) & reg.FIFO_SIZE)] = shown
        elif register == reg.ACCEL_XOUT_H and len(data) == 6:
            axes = (int.from_bytes(data[i : i + 2], "big", signed=True) for i in (0, 2, 4))
            self._magnitudes_g.append(math.hypot(*axes) / reg.ACCEL_LSB_PER_G[0])
        elif register == reg.FIFO_EN and self._fifo_en is None and data[0]:
            self._fifo_en = data[0]
        elif register == reg.PWR_MGMT_1 and self._was_reset and self._asleep is None:
            self._asleep = bool(data[0] & reg.PWR_MGMT_1_SLEEP)

    @property
    def fifo_bytes(self) -> int | None:
        """What its FIFO holds after a reset, 0 where it has none; None where filling it was never tried."""
        return self._fifo_bytes.get(False)

    def part(self, who_am_i: int) -> Part:
        """The part that behaves so and answers `who_am_i`; by its answer alone where its FIFO was never filled.

        Raises
        ------
        ChipError : it is none that is known here.
        """
        if self.fifo_bytes is None:
            return part_of(who_am_i)
        part = replace(
            self._part_by_behaviour(who_am_i, self.fifo_bytes), wide_fifo_bytes=self._wide_bytes(self.fifo_bytes)
        )
        revision = part.family.half_range_revision
        if revision and self._magnitudes_g and HALF_G[0] < _median(self._magnitudes_g) < HALF_G[1]:
            return replace(part, chip=f"{part.chip}{revision}", accel_sensitivity=HALF)
        return part

    def _wide_bytes(self, fifo_bytes: int) -> int | None:
        """What the FIFO holds with FIFO_SIZE set, where that is more."""
        wide = self._fifo_bytes.get(True, 0)
        return wide if wide > fifo_bytes + FIFO_SLACK_BYTES else None

    def _part_by_behaviour(self, who_am_i: int, fifo_bytes: int) -> Part:
        known = PARTS.get(who_am_i)
        if known is not None and self._fits(known.family, fifo_bytes):
            nearly = abs(fifo_bytes - known.family.fifo_bytes) <= FIFO_SLACK_BYTES
            return known if nearly else _with_fifo(known, fifo_bytes)
        alike = max(families_with_fifo(fifo_bytes), key=self._similarity, default=None)
        if alike is not None:
            return Part(alike.name, who_am_i, alike)
        if known is not None:
            return _with_fifo(known, fifo_bytes)
        raise ChipError(
            f"the chip answers 0x{who_am_i:02x} to WHO_AM_I and its FIFO holds {fifo_bytes} bytes, as in no part"
            " that is known here",
            "check which chip is at this address",
        )

    def _fits(self, family: Family, fifo_bytes: int) -> bool:
        """Whether a chip of this row may have such a FIFO: parts that share their registers come with other sizes."""
        sizes = {family.fifo_bytes, family.widest_fifo_bytes or family.fifo_bytes}
        nearly = any(abs(fifo_bytes - size) <= FIFO_SLACK_BYTES for size in sizes)
        return nearly and self._fifo_en in (None, reg.FIFO_EN_FRAME, family.fifo_en_frame)

    def _similarity(self, family: Family) -> tuple[int, int]:
        """How many of the other signs speak for this row, and how near its FIFO is."""
        wide = self._wide_bytes(self.fifo_bytes or 0) or 0
        signs = (
            self._fifo_en == family.fifo_en_frame,
            abs(wide - (family.widest_fifo_bytes or 0)) <= FIFO_SLACK_BYTES,
            self._asleep == family.asleep,
        )
        return sum(signs), -abs(family.fifo_bytes - (self.fifo_bytes or 0))


def _with_fifo(part: Part, fifo_bytes: int) -> Part:
    return replace(part, family=replace(part.family, fifo_bytes=fifo_bytes))


def describe_mismatch(sensor: Sensor) -> str | None:
    """What a person should know of a chip that is not what it says it is; None of any other."""
    if sensor.chip is None or sensor.who_am_i is None:
        return None
    named = PARTS.get(sensor.who_am_i)
    if named is not None and named.chip == sensor.chip:
        return None
    answers = f"the chip answers 0x{sensor.who_am_i:02x} to WHO_AM_I"
    if named is None:
        return f"{answers}, which no part known here does; it behaves as an {sensor.chip} and is treated as one"
    revision = named.family.half_range_revision
    if revision and sensor.chip == f"{named.chip}{revision}":
        half = "with half the sensitivity: its range is twice the nominal"
        return f"the chip is an {named.chip} of revision {revision}, {half}"
    return f"{answers} as an {named.chip} does, but behaves as an {sensor.chip} and is treated as one"


def _median(values: list[float]) -> float:
    """As of the standard library's statistics, which takes fractions along and loads slowly."""
    n, values = len(values), sorted(values)
    return (values[(n - 1) // 2] + values[n // 2]) / 2
