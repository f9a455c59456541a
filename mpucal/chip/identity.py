"""Which part a chip is, from what it answered and how its FIFO behaved; makes no access itself.

Clones answer WHO_AM_I as they like. What they cannot disguise is how many bytes their FIFO holds: 1024 in a 6050,
512 in a 6500 (PS-MPU-6000A r3.4 section 1.2, PS-MPU-9250A r1.0 section 1.3), 512 that grow to 4096 where a word in
ACCEL_CONFIG2 asks for it in an ICM-20689; and that an accelerometer at rest shows 1 g, or half of it in revision C.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from statistics import median

from ..data import Sensor
from ..errors import ChipError
from . import registers as reg
from .families import PARTS, Family, Part, of_fifo, part_of

# a full FIFO may say a few bytes less than it holds
FIFO_SLACK_BYTES = 8

# magnitudes [g] that a board in somebody's hand shows, at half the sensitivity
HALF_G = (0.35, 0.65)
HALF = 0.5


class Behaviour:
    """What a chip's replies say about it, from its identity on until it starts to measure."""

    def __init__(self) -> None:
        self._fifo_bytes: dict[bool, int] = {}
        self._magnitudes_g: list[float] = []

    def saw(self, register: int, data: bytes, held: Mapping[int, int]) -> None:
        """`data` was read from `register` on, while the registers were known to hold `held`."""
        if register == reg.FIFO_COUNT_H and held.get(reg.FIFO_EN, 0) == reg.FIFO_EN_FRAME:
            widened = bool(held.get(reg.ACCEL_CONFIG2, 0) & reg.FIFO_SIZE)
            self._fifo_bytes[widened] = int.from_bytes(data, "big")
        elif register == reg.ACCEL_XOUT_H and len(data) == 6:
            axes = (int.from_bytes(data[i : i + 2], "big", signed=True) for i in (0, 2, 4))
            self._magnitudes_g.append(math.hypot(*axes) / reg.ACCEL_LSB_PER_G[0])

    @property
    def fifo_bytes(self) -> int | None:
        """What its FIFO holds; None where it was never filled."""
        return self._fifo_bytes.get(False)

    def part(self, who_am_i: int) -> Part:
        """The part that behaves so and answers `who_am_i`; by its answer alone where its FIFO was never filled.

        Raises
        ------
        ChipError : it is none that is known here.
        """
        if self.fifo_bytes is None:
            return part_of(who_am_i)
        part = self._behaving(who_am_i, self.fifo_bytes)
        revision = part.family.half_range_revision
        if revision and self._magnitudes_g and HALF_G[0] < median(self._magnitudes_g) < HALF_G[1]:
            return replace(part, chip=f"{part.chip}{revision}", accel_sensitivity=HALF)
        return part

    def _behaving(self, who_am_i: int, fifo_bytes: int) -> Part:
        known = PARTS.get(who_am_i)
        grows = self._fifo_bytes.get(True, 0) > fifo_bytes + FIFO_SLACK_BYTES
        family = _family(fifo_bytes, grows)
        if known is not None and (family is None or family.fifo_bytes == known.family.fifo_bytes):
            if family is not None and family.widest_fifo_bytes and not known.family.widest_fifo_bytes:
                return Part(family.name, who_am_i, family)
            return known if family is not None else replace(known, family=replace(known.family, fifo_bytes=fifo_bytes))
        if family is None:
            raise ChipError(
                f"the chip answers 0x{who_am_i:02x} to WHO_AM_I and its FIFO holds {fifo_bytes} bytes, as in no part"
                " that is known here",
                "check which chip is at this address",
            )
        return Part(family.name, who_am_i, family)


def _family(fifo_bytes: int, grows: bool) -> Family | None:
    near = [family for family in of_fifo(fifo_bytes) if family.fifo_bytes - FIFO_SLACK_BYTES <= fifo_bytes]
    alike = [family for family in near if bool(family.widest_fifo_bytes) == grows]
    return next(iter(alike or near), None)


def remark(sensor: Sensor) -> str | None:
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
