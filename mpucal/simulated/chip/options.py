"""What `sim:key=value,...` asks for. Knows no chip: only which words there are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ...data import Vector
from ...errors import UsageError
from ..hand import KINDS
from .bus import KHZ
from .clock import CLOCKS
from .faults import KINDS as FAULTS
from .faults import Fault
from .models import MODELS, OFFSETS


@dataclass(frozen=True)
class Options:
    """A simulated chip and its hand, as asked for; None: as drawn from the seed.

    Attributes
    ----------
    chip, hand, pace : a name each. who_am_i : another identity than the chip's own.
    offsets : what a count of its accelerometer offsets is, in LSB/g, or readonly.
    seed : of the sensor, its noise and the hand. rate_error_ppm : how fast the sample clock runs.
    D, K : (3, 3). b_a [m/s^2], b_omega [rad/s] : (3,).
    fault : what goes wrong, and when. noise : times the data sheet's densities. temperature_c : of the die.
    khz : how fast the bus is.
    """

    chip: str = "mpu6050"
    who_am_i: int | None = None
    offsets: str = "2048"
    seed: int = 0
    hand: str = "guided"
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
        """Of `sim` or `sim:key=value,...`; vectors and matrices by row, as 0.1/0.2/0.3.

        Parameters
        ----------
        seed : given beside `text`.

        Raises
        ------
        UsageError : an unknown key or value, a key given twice, or two seeds.
        """
        values: dict[str, Any] = {}
        words = text.partition(":")[2]
        for word in words.split(",") if words else []:
            key, equals, value = word.partition("=")
            if not equals or key not in PARSERS:
                raise UsageError(f"sim: does not know {word!r}", f"its keys are {', '.join(PARSERS)}")
            if key in values:
                raise UsageError(f"sim: {key} is given twice", "give it once")
            values[key] = _value(key, value)
        if seed is not None and values.setdefault("seed", seed) != seed:
            raise UsageError(f"sim: seed={values['seed']} and --seed {seed} differ", "give one of them")
        return cls(**values)


def _value(key: str, text: str) -> Any:
    parse, expected = PARSERS[key]
    try:
        return parse(text)
    except (ValueError, KeyError):
        raise UsageError(f"sim: {key}={text} is not {expected}", "correct it, or leave it out") from None


def _number(text: str) -> float:
    value = float(text)
    if not np.isfinite(value):
        raise ValueError(text)
    return value


def _not_negative(text: str) -> float:
    if (value := _number(text)) < 0:
        raise ValueError(text)
    return value


def _positive(text: str) -> float:
    if (value := _number(text)) <= 0:
        raise ValueError(text)
    return value


def _seed(text: str) -> int:
    if (value := int(text)) < 0:
        raise ValueError(text)
    return value


def _identity(text: str) -> int:
    if not 0 <= (value := int(text, 0)) <= 0xFF:
        raise ValueError(text)
    return value


def _faults(text: str) -> tuple[Fault, ...]:
    return tuple(Fault.parse(part) for part in text.split("/"))


def _vector(text: str) -> Vector:
    return np.array([_number(part) for part in text.split("/")]).reshape(3)


def _matrix(text: str) -> Vector:
    matrix = np.array([_number(part) for part in text.split("/")]).reshape(3, 3)
    if np.linalg.matrix_rank(matrix) < 3:
        raise ValueError(text)
    return matrix


def _one_of(names: Mapping[str, object]) -> tuple[Callable[[str], str], str]:
    def parse(text: str) -> str:
        names[text]
        return text

    return parse, "one of " + ", ".join(names)


PARSERS: dict[str, tuple[Callable[[str], Any], str]] = {
    "chip": _one_of(MODELS),
    "who_am_i": (_identity, "a byte such as 0x68"),
    "offsets": _one_of(OFFSETS),
    "seed": (_seed, "a whole number from 0 on"),
    "hand": _one_of(KINDS),
    "pace": _one_of(CLOCKS),
    "fault": (_faults, "NAME@SECONDS, or several with / between them, of " + ", ".join(FAULTS)),
    "rate_error_ppm": (_number, "a number"),
    "D": (_matrix, "nine numbers with / between them, by row, that can be inverted"),
    "b_a": (_vector, "three numbers with / between them, in m/s^2"),
    "K": (_matrix, "nine numbers with / between them, by row, that can be inverted"),
    "b_omega": (_vector, "three numbers with / between them, in rad/s"),
    "noise": (_not_negative, "a number from 0 on"),
    "temperature_c": (_number, "a number of degrees Celsius"),
    "khz": (_positive, "a number above 0"),
}
