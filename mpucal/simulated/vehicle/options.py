"""What `sim:key=value,...` asks of the simulated vehicle. Knows no message: only which words there are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from ...errors import UsageError
from ...mavlink.parameters.names import CUSTOM_ANGLES
from ..hand import KINDS

FIRMWARES = ("ardupilot", "px4")
PACES = ("fast", "real")
MOST_IMUS = 3
LAST_ORIENTATION = 40
# name -> whether it begins at a time, as in fault=NAME@SECONDS
FAULTS = {
    "arm": True,
    "reboot": True,
    "silence": True,
    "second_station": True,
    "loss": False,
    "reorder": False,
    "duplicate": False,
    "no_storage": False,
}


@dataclass(frozen=True)
class Options:
    """A simulated vehicle and the hand that holds it, as asked for.

    Attributes
    ----------
    firmware : ardupilot or px4. imus : how many it has. system : its MAVLink id.
    rotation : MAV_SENSOR_ORIENTATION of its board. highres : an ArduPilot of 4.6 or later, with HIGHRES_IMU.
    seed : of its sensors, their noise and the hand. hand : which. pace : fast or real, of `--mavlink sim`.
    rotate_at : s after which the hand begins to turn it though nobody prompts; None: it waits.
    faults : name -> when it begins [s]. refuse : the parameter that it will not set.
    parameters : values that it holds at the start.
    """

    firmware: str = "ardupilot"
    imus: int = 2
    system: int = 1
    rotation: int = 0
    highres: bool = True
    seed: int = 0
    hand: str = "guided"
    pace: str = "fast"
    rotate_at: float | None = None
    faults: Mapping[str, float] = field(default_factory=dict)
    refuse: str | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str, seed: int | None = None) -> Self:
        """Of `sim` or `sim:key=value,...`; a key in capitals is a parameter.

        Parameters
        ----------
        seed : given beside `text`.

        Raises
        ------
        UsageError : an unknown key or value, a key given twice, or two seeds.
        """
        values: dict[str, Any] = {"faults": {}, "parameters": {}}
        words = text.partition(":")[2]
        for word in words.split(",") if words else []:
            key, equals, value = word.partition("=")
            if not equals or not (key in PARSERS or key.isupper()):
                raise UsageError(
                    f"the simulated vehicle does not know {word!r}",
                    f"its keys are {', '.join(PARSERS)}, or a parameter's name",
                )
            if key == "fault":
                values["faults"].update(_value(key, value))
            elif key.isupper():
                values["parameters"][key] = _value("parameter", value)
            elif key in values:
                raise UsageError(f"the simulated vehicle's {key} is given twice", "give it once")
            else:
                values[key] = _value(key, value)
        if seed is not None and values.setdefault("seed", seed) != seed:
            raise UsageError(f"seed={values['seed']} and --seed {seed} differ", "give one of them")
        return cls(**values)


def _value(key: str, text: str) -> Any:
    parse, expected = PARSERS.get(key, (float, "a number"))
    try:
        return parse(text)
    except (ValueError, KeyError):
        raise UsageError(f"{key}={text} is not {expected}", "correct it, or leave it out") from None


def _fault(text: str) -> dict[str, float]:
    name, _, at = text.partition("@")
    if FAULTS[name] != bool(at):
        raise ValueError(text)
    return {name: float(at) if at else 0.0}


def _within(lowest: int, highest: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not lowest <= (value := int(text)) <= highest:
            raise ValueError(text)
        return value

    return parse


def _orientation(text: str) -> int:
    value = int(text)
    if not (0 <= value <= LAST_ORIENTATION or value in CUSTOM_ANGLES):
        raise ValueError(text)
    return value


def _one_of(names: tuple[str, ...]) -> tuple[Callable[[str], str], str]:
    def parse(text: str) -> str:
        if text not in names:
            raise ValueError(text)
        return text

    return parse, "one of " + ", ".join(names)


def _seconds(text: str) -> float:
    if not 0 <= (value := float(text)) < float("inf"):
        raise ValueError(text)
    return value


PARSERS: dict[str, tuple[Callable[[str], Any], str]] = {
    "firmware": _one_of(FIRMWARES),
    "imus": (_within(1, MOST_IMUS), f"a number from 1 to {MOST_IMUS}"),
    "system": (_within(1, 250), "a number from 1 to 250"),
    "rotation": (_orientation, "a MAV_SENSOR_ORIENTATION: 0 to 40, 100 to 102"),
    "highres": (lambda text: {"yes": True, "no": False}[text], "yes or no"),
    "seed": (_within(0, 1 << 62), "a whole number from 0 on"),
    "hand": _one_of(tuple(KINDS)),
    "pace": _one_of(PACES),
    "rotate_at": (_seconds, "a number of seconds"),
    "fault": (_fault, "one of " + ", ".join(f"{name}@SECONDS" if at else name for name, at in FAULTS.items())),
    "refuse": (str, "a parameter's name"),
}
