"""Options `sim:key=value,...`: their base, and parsers of values that the chip's and the vehicle's share."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, Self, get_origin, get_type_hints

from ..errors import UsageError, did_you_mean
from ..sources.table import number, whole_number
from .faults import Fault, Where, fault_kinds

FAULT = "fault"
# A function that parses a value, and a description of the values that it accepts.
Parser = tuple[Callable[[str], Any], str]


@dataclass(frozen=True)
class SimulationOptions:
    """Base of the options of a simulation: each field is a key, `Annotated` with its parser, unless it is REST."""

    # the field that takes numbers whose names are in capitals
    REST: ClassVar[str | None] = None

    @classmethod
    @cache
    def parsers(cls) -> dict[str, Parser]:
        """Return the parser of each key."""
        hints = get_type_hints(cls, include_extras=True)
        return {key: hint.__metadata__[0] for key, hint in hints.items() if get_origin(hint) is Annotated}

    @classmethod
    def parse(cls, text: str, seed: int | None = None) -> Self:
        """Parse `sim` or `sim:key=value,...`; faults that are given more than once add up.

        Parameters
        ----------
        seed : of its own option.

        Raises
        ------
        UsageError : an unknown key or value, a key given twice, or two seeds.
        """
        parsers, rest = cls.parsers(), dict[str, float]()
        values: dict[str, Any] = {} if cls.REST is None else {cls.REST: rest}
        words = text.partition(":")[2]
        for word in words.split(",") if words else []:
            key, equals, value = word.partition("=")
            named = cls.REST is not None and key.isupper()
            if not equals or not (named or key in parsers):
                more = "" if cls.REST is None else ", or a parameter's name"
                keys = f"its keys are {', '.join(parsers)}{more}{did_you_mean(key, parsers)}"
                raise UsageError(f"sim: does not know {word!r}", keys)
            made = _value(key, value, (number, "a number") if named else parsers[key])
            if named:
                rest[key] = made
            elif key in values and key != FAULT:
                raise UsageError(f"sim: {key} is given twice", "give it once")
            else:
                values[key] = (*values.get(key, ()), *made) if key == FAULT else made
        if seed is not None and values.setdefault("seed", seed) != seed:
            raise UsageError(f"sim: seed={values['seed']} and --seed {seed} differ", "give one of them")
        return cls(**values)


def _value(key: str, text: str, parser: Parser) -> Any:
    parse, expected = parser
    try:
        return parse(text)
    except (ValueError, KeyError):
        nearly = did_you_mean(text.partition("@")[0], re.findall(r"[a-z]\w\w+", expected))
        raise UsageError(f"sim: {key}={text} is not {expected}", f"correct it, or leave it out{nearly}") from None


def at_least(lowest: float) -> Parser:
    """Return the parser of a number from `lowest` on."""

    def parse(text: str) -> float:
        if (value := number(text)) < lowest:
            raise ValueError(text)
        return value

    return parse, f"a number from {lowest:g} on"


def whole(lowest: int, highest: int | None = None) -> Parser:
    """Return the parser of a whole number within limits."""
    allowed = "on" if highest is None else f"to {highest}"
    return whole_number(lowest, highest), f"a whole number from {lowest} {allowed}"


def one_of(names: Collection[str]) -> Parser:
    """Return the parser of a name that is in `names` when the text is parsed."""

    def parse(text: str) -> str:
        if text not in names:
            raise ValueError(text)
        return text

    return parse, "one of " + ", ".join(names)


def faults(*where: Where) -> Parser:
    """Return the parser of one or several faults that affect any of these parts."""
    timed = ", ".join(name for name, kind in fault_kinds(*where).items() if kind.timed)
    others = ", ".join(name for name, kind in fault_kinds(*where).items() if not kind.timed)
    expected = f"NAME@SECONDS, or several with / between them, of {timed}"

    def parse(text: str) -> tuple[Fault, ...]:
        return tuple(Fault.parse(part, *where) for part in text.split("/"))

    return parse, expected + (f"; or, without a time, of {others}" if others else "")
