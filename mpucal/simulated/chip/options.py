"""Options `sim:key=value,...` of the simulated chip and its hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from ...data import Vector
from ..disturbance import ARMS, USUAL_ARM
from ..faults import OF_CHIP, Fault, Where
from ..hands import HANDS
from ..option_text import FAULT, Parser, at_least, faults, number, one_of, parse_options, whole
from .bus import CLOCKS, KHZ
from .models import MODELS, OFFSETS


@dataclass(frozen=True)
class ChipOptions:
    """Options of a simulated chip and its hand; None: drawn from the seed.

    Attributes
    ----------
    chip, hand, arm, pace : a name each. who_am_i : another identity than the chip's own.
    offsets : scale of the accelerometer offsets in LSB/g, or readonly.
    seed : of the sensor, its noise and the hand. rate_error_ppm : of the sample clock.
    D, K : (3, 3). b_a [m/s^2], b_omega [rad/s] : (3,).
    fault : faults with their times. noise : factor of the data sheet's densities. temperature_c : of the die.
    khz : bit rate of the bus.
    """

    chip: str = "mpu6050"
    who_am_i: int | None = None
    offsets: str = "2048"
    seed: int = 0
    hand: str = "guided"
    arm: str = USUAL_ARM
    pace: str = "fast"
    rate_error_ppm: float | None = None
    D: Vector | None = None
    b_a: Vector | None = None
    K: Vector | None = None
    b_omega: Vector | None = None
    fault: tuple[Fault, ...] = ()
    noise: float = 1.0
    temperature_c: float | None = None
    khz: float = KHZ

    @classmethod
    def parse(cls, text: str, seed: int | None = None) -> Self:
        """Parse `sim` or `sim:key=value,...`; vectors and matrices are by row, as 0.1/0.2/0.3.

        Parameters
        ----------
        seed : of its own option.

        Raises
        ------
        UsageError : an unknown key or value, a key given twice, or two seeds.
        """
        return cls(**parse_options(text, PARSERS, seed))


def _positive(text: str) -> float:
    if (value := number(text)) <= 0:
        raise ValueError(text)
    return value


def _identity(text: str) -> int:
    if not 0 <= (value := int(text, 0)) <= 0xFF:
        raise ValueError(text)
    return value


def _vector(text: str) -> Vector:
    return np.array([number(part) for part in text.split("/")]).reshape(3)


def _matrix(text: str) -> Vector:
    matrix = np.array([number(part) for part in text.split("/")]).reshape(3, 3)
    if np.linalg.matrix_rank(matrix) < 3:
        raise ValueError(text)
    return matrix


PARSERS: dict[str, Parser] = {
    "chip": one_of(MODELS),
    "who_am_i": (_identity, "a byte such as 0x68"),
    "offsets": one_of(OFFSETS),
    "seed": whole(0),
    "hand": one_of(HANDS),
    "arm": one_of(ARMS),
    "pace": one_of(CLOCKS),
    FAULT: faults(*OF_CHIP, Where.DEFECT, Where.HAND),
    "rate_error_ppm": (number, "a number"),
    "D": (_matrix, "nine numbers with / between them, by row, that can be inverted"),
    "b_a": (_vector, "three numbers with / between them, in m/s^2"),
    "K": (_matrix, "nine numbers with / between them, by row, that can be inverted"),
    "b_omega": (_vector, "three numbers with / between them, in rad/s"),
    "noise": at_least(0),
    "temperature_c": (number, "a number of degrees Celsius"),
    "khz": (_positive, "a number above 0"),
}
