"""Options `sim:key=value,...` of the simulated vehicle and its hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

from ...mavlink.parameters.mounting import CUSTOM_ANGLES
from ...mavlink.parameters.slots import ARDUPILOT_IMUS
from ..disturbance import ARMS, USUAL_ARM
from ..faults import OF_VEHICLE, Fault, Where
from ..hands import HANDS
from ..option_text import FAULT, Parser, at_least, faults, one_of, parse_options, whole

FIRMWARES = ("ardupilot", "px4")
TYPES = ("copter", "plane", "rover")
PACES = ("fast", "real")


@dataclass(frozen=True)
class VehicleOptions:
    """Options of a simulated vehicle and the hand that holds it.

    Attributes
    ----------
    firmware : ardupilot or px4. type : copter, plane or rover. imus : their number. system : its MAVLink id.
    rotation : MAV_SENSOR_ORIENTATION of its board. highres : an ArduPilot of 4.6 or later, with HIGHRES_IMU.
    seed : of its sensors, their noise and the hand. hand, arm : its kind, and how it is held. pace : fast or real.
    rotate_at : s after which the hand begins to turn it without a prompt; None: it waits for one.
    fault : faults with their times. refuse : the parameter that it refuses to set.
    parameters : values at the start.
    """

    firmware: str = "ardupilot"
    type: str = "copter"
    imus: int = 2
    system: int = 1
    rotation: int = 0
    highres: bool = True
    seed: int = 0
    hand: str = "guided"
    arm: str = USUAL_ARM
    pace: str = "fast"
    rotate_at: float | None = None
    fault: tuple[Fault, ...] = ()
    refuse: str | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str, seed: int | None = None) -> Self:
        """Parse `sim` or `sim:key=value,...`; a key in capitals is a parameter.

        Parameters
        ----------
        seed : of its own option.

        Raises
        ------
        UsageError : an unknown key or value, a key given twice, or two seeds.
        """
        return cls(**parse_options(text, PARSERS, seed, "parameters"))

    def has_fault(self, name: str) -> bool:
        """Return True if the options name this fault."""
        return any(fault.name == name for fault in self.fault)


def _orientation(text: str) -> int:
    value = int(text)
    if not (value in range(41) or value in CUSTOM_ANGLES):
        raise ValueError(text)
    return value


PARSERS: dict[str, Parser] = {
    "firmware": one_of(FIRMWARES),
    "type": one_of(TYPES),
    "imus": whole(1, ARDUPILOT_IMUS),
    "system": whole(1, 250),
    "rotation": (_orientation, "a MAV_SENSOR_ORIENTATION: 0 to 40, 100 to 102"),
    "highres": (lambda text: {"yes": True, "no": False}[text], "yes or no"),
    "seed": whole(0),
    "hand": one_of(HANDS),
    "arm": one_of(ARMS),
    "pace": one_of(PACES),
    "rotate_at": at_least(0),
    FAULT: faults(*OF_VEHICLE, Where.HAND),
    "refuse": (str, "a parameter's name"),
}
