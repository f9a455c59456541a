"""Identification of a part from its answers and behaviour; this module makes no access itself.

The answer of a clone to WHO_AM_I cannot be trusted. The size of its FIFO can: 1024 bytes in a 6050, 512 in a 6500
(PS-MPU-6000A r3.4 section 1.2, PS-MPU-9250A r1.0 section 1.3). So can other signs: if the FIFO grows when FIFO_SIZE of
ACCEL_CONFIG2 asks for it; which bits of FIFO_EN it keeps; if it sleeps after a reset; and if an accelerometer at rest
shows 1 g, or half of it as in revision C. If several parts behave alike, as an MPU-6500 and an ICM-20689 do, WHO_AM_I
decides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..data import Sensor
from ..errors import ChipError
from . import registers as reg
from .families import FIFO_SLACK_BYTES, PARTS, Family, Part, families_with_fifo, part_of

# A board at rest or in a hand shows a magnitude [g] in this range if its sensitivity is half of the data sheet's.
MIN_HALF_G, MAX_HALF_G = 0.35, 0.65


class Behaviour:
    """Signs in a chip's replies, from its identity on until it starts to measure."""

    def __init__(self) -> None:
        self._last_count = 0
        self._fifo_bytes: dict[bool, int] = {}
        self._magnitudes_g: list[float] = []
        self._fifo_en: int | None = None
        self._was_reset = False
        self._asleep: bool | None = None

    def reset(self) -> None:
        """Note that the chip was reset."""
        self._was_reset = True

    def observe(self, register: int, data: bytes, held: Mapping[int, int]) -> None:
        """Take `data` read from `register` on, while the registers were known to hold `held`."""
        if register == reg.FIFO_COUNT_H and (held.get(reg.FIFO_EN) or held.get(reg.USER_CTRL)):
            count, before = int.from_bytes(data, "big"), self._last_count
            self._last_count = count
            if count == before:
                self._fifo_bytes[bool(held.get(reg.ACCEL_CONFIG2, 0) & reg.FIFO_SIZE)] = count
        elif register == reg.ACCEL_XOUT_H and len(data) == 6:
            axes = (int.from_bytes(data[i : i + 2], "big", signed=True) for i in (0, 2, 4))
            self._magnitudes_g.append(math.hypot(*axes) / reg.ACCEL_LSB_PER_G[0])
        elif register == reg.FIFO_EN and self._fifo_en is None and data[0]:
            self._fifo_en = data[0]
        elif register == reg.PWR_MGMT_1 and self._was_reset and self._asleep is None:
            self._asleep = bool(data[0] & reg.PWR_MGMT_1_SLEEP)

    def part(self, who_am_i: int) -> Part:
        """Return the part that behaves so and answers `who_am_i`; by its answer alone if its FIFO was never filled.

        Raises
        ------
        ChipError : an unknown part.
        """
        fifo_bytes = self._fifo_bytes.get(False)
        if fifo_bytes is None:
            return part_of(who_am_i)
        part = self._part_by_behaviour(who_am_i, fifo_bytes)._replace(wide_fifo_bytes=self._wide_bytes(fifo_bytes))
        revision = part.family.half_range_revision
        sensitivity = accel_sensitivity(float(np.median(self._magnitudes_g or 1.0))) if revision else 1.0
        return part if sensitivity == 1.0 else part._replace(chip=part.chip + revision, accel_sensitivity=sensitivity)

    def _wide_bytes(self, fifo_bytes: int) -> int | None:
        """Return the size of the FIFO with FIFO_SIZE set if it is larger, else None."""
        wide = self._fifo_bytes.get(True, 0)
        return wide if wide > fifo_bytes + FIFO_SLACK_BYTES else None

    def _part_by_behaviour(self, who_am_i: int, fifo_bytes: int) -> Part:
        named = PARTS.get(who_am_i)
        if named is not None and self._fits(named.family, fifo_bytes):
            nearly = abs(fifo_bytes - named.family.fifo_bytes) <= FIFO_SLACK_BYTES
            return named if nearly else _with_fifo(named, fifo_bytes)
        families = families_with_fifo(fifo_bytes)
        if families:
            nearest = max(families, key=lambda family: self._similarity(family, fifo_bytes))
            return Part(nearest.name, who_am_i, nearest)
        if named is not None:
            return _with_fifo(named, fifo_bytes)
        raise ChipError(
            f"the chip answers 0x{who_am_i:02x} to WHO_AM_I and its FIFO holds {fifo_bytes} bytes: no known part"
            " does that",
            "check which chip is at this address",
        )

    def _fits(self, family: Family, fifo_bytes: int) -> bool:
        """Return True if a part of this family may have such a FIFO: parts with equal registers differ in its size."""
        sizes = {family.fifo_bytes, family.widest_fifo_bytes or family.fifo_bytes}
        nearly = any(abs(fifo_bytes - size) <= FIFO_SLACK_BYTES for size in sizes)
        return nearly and self._fifo_en in (None, reg.FIFO_EN_FRAME, family.fifo_en_frame)

    def _similarity(self, family: Family, fifo_bytes: int) -> tuple[int, int]:
        """Return how many of the other signs agree with this family, and how near its FIFO's size is."""
        wide = self._wide_bytes(fifo_bytes) or 0
        signs = (
            self._fifo_en == family.fifo_en_frame,
            abs(wide - (family.widest_fifo_bytes or 0)) <= FIFO_SLACK_BYTES,
            self._asleep == family.asleep,
        )
        return sum(signs), -abs(family.fifo_bytes - fifo_bytes)


def accel_sensitivity(magnitude_g: float) -> float:
    """Return the accelerometer's sensitivity relative to the data sheet's, from the median magnitude that it shows."""
    return 0.5 if MIN_HALF_G < magnitude_g < MAX_HALF_G else 1.0


def _with_fifo(part: Part, fifo_bytes: int) -> Part:
    return part._replace(family=part.family._replace(fifo_bytes=fifo_bytes))


def describe_mismatch(sensor: Sensor) -> str | None:
    """Return a remark on a chip that is not the part it claims to be; None for any other."""
    if sensor.chip is None or sensor.who_am_i is None:
        return None
    named = PARTS.get(sensor.who_am_i)
    if named is not None and named.chip == sensor.chip:
        return None
    answers = f"the chip answers 0x{sensor.who_am_i:02x} to WHO_AM_I"
    if named is None:
        return f"{answers}, as no known part does; it behaves as an {sensor.chip} and is treated as one"
    revision = named.family.half_range_revision
    if revision and sensor.chip == f"{named.chip}{revision}":
        half = "with half the sensitivity: its range is twice the nominal"
        return f"the chip is an {named.chip} of revision {revision}, {half}"
    return f"{answers} as an {named.chip} does, but behaves as an {sensor.chip} and is treated as one"
