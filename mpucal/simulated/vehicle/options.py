"""Options `sim:key=value,...` of the simulated vehicle and its hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from ...mavlink.parameters.mounting import CUSTOM_ANGLES
from ...mavlink.parameters.slots import ARDUPILOT_IMUS
from ..disturbance import ARMS, USUAL_ARM
from ..faults import OF_VEHICLE, Fault, Where
from ..hands import HANDS
from ..option_text import SimulationOptions, at_least, faults, one_of, whole

FIRMWARES = ("ardupilot", "px4")
TYPES = ("copter", "plane", "rover")
PACES = ("fast", "real")


def _orientation(text: str) -> int:
    value = int(text)
    if not (value in range(41) or value in CUSTOM_ANGLES):
        raise ValueError(text)
    return value


@dataclass(frozen=True)
class VehicleOptions(SimulationOptions):
    """Options of a simulated vehicle and the hand that holds it; a key in capitals is a parameter.

    Attributes
    ----------
    firmware : ardupilot or px4. type : copter, plane or rover. imus : their number. system : its MAVLink id.
    rotation : MAV_SENSOR_ORIENTATION of its board. highres : an ArduPilot of 4.6 or later, with HIGHRES_IMU.
    seed : of its sensors, their noise and the hand. hand, arm : its kind, and how it is held. pace : fast or real.
    rotate_at : s after which the hand begins to turn it without a prompt; None: it waits for one.
    fault : faults with their times. refuse : the parameter that it refuses to set.
    parameters : values at the start.
    """

    firmware: Annotated[str, one_of(FIRMWARES)] = "ardupilot"
    type: Annotated[str, one_of(TYPES)] = "copter"
    imus: Annotated[int, whole(1, ARDUPILOT_IMUS)] = 2
    system: Annotated[int, whole(1, 250)] = 1
    rotation: Annotated[int, (_orientation, "a MAV_SENSOR_ORIENTATION: 0 to 40, 100 to 102")] = 0
    highres: Annotated[bool, (lambda text: {"yes": True, "no": False}[text], "yes or no")] = True
    seed: Annotated[int, whole(0)] = 0
    hand: Annotated[str, one_of(HANDS)] = "guided"
    arm: Annotated[str, one_of(ARMS)] = USUAL_ARM
    pace: Annotated[str, one_of(PACES)] = "fast"
    rotate_at: Annotated[float | None, at_least(0)] = None
    fault: Annotated[tuple[Fault, ...], faults(*OF_VEHICLE, Where.HAND)] = ()
    refuse: Annotated[str | None, (str, "a parameter's name")] = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    REST = "parameters"
