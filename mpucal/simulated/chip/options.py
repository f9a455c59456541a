"""Options `sim:key=value,...` of the simulated chip and its hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ...data import Vector
from ..disturbance import ARMS, USUAL_ARM
from ..faults import OF_CHIP, Fault, Where
from ..hands import HANDS
from ..option_text import SimulationOptions, at_least, faults, number, one_of, whole
from .bus import CLOCKS, KHZ
from .models import MODELS, OFFSETS

MATRIX = "nine numbers with / between them, by row, that can be inverted"


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


@dataclass(frozen=True)
class ChipOptions(SimulationOptions):
    """Options of a simulated chip and its hand; None: drawn from the seed.

    Vectors and matrices are given by row, as 0.1/0.2/0.3.

    Attributes
    ----------
    chip, hand, arm, pace : a name each. who_am_i : another identity than the chip's own.
    offsets : scale of the accelerometer offsets in LSB/g, or readonly.
    seed : of the sensor, its noise and the hand. rate_error_ppm : of the sample clock.
    D, K : (3, 3). b_a [m/s^2], b_omega [rad/s] : (3,).
    fault : faults with their times. noise : factor of the data sheet's densities. temperature_c : of the die.
    khz : bit rate of the bus.
    """

    chip: Annotated[str, one_of(MODELS)] = "mpu6050"
    who_am_i: Annotated[int | None, (_identity, "a byte such as 0x68")] = None
    offsets: Annotated[str, one_of(OFFSETS)] = "2048"
    seed: Annotated[int, whole(0)] = 0
    hand: Annotated[str, one_of(HANDS)] = "guided"
    arm: Annotated[str, one_of(ARMS)] = USUAL_ARM
    pace: Annotated[str, one_of(CLOCKS)] = "fast"
    fault: Annotated[tuple[Fault, ...], faults(*OF_CHIP, Where.DEFECT, Where.HAND)] = ()
    rate_error_ppm: Annotated[float | None, (number, "a number")] = None
    D: Annotated[Vector | None, (_matrix, MATRIX)] = None
    b_a: Annotated[Vector | None, (_vector, "three numbers with / between them, in m/s^2")] = None
    K: Annotated[Vector | None, (_matrix, MATRIX)] = None
    b_omega: Annotated[Vector | None, (_vector, "three numbers with / between them, in rad/s")] = None
    noise: Annotated[float, at_least(0)] = 1.0
    temperature_c: Annotated[float | None, (number, "a number of degrees Celsius")] = None
    khz: Annotated[float, (_positive, "a number above 0")] = KHZ
