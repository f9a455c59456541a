"""Who sends an autopilot's HEARTBEAT, and from where."""

from __future__ import annotations

from dataclasses import dataclass

from .dialect import Message, dialect
from .firmwares import ARDUPILOT, PX4


@dataclass(frozen=True)
class Vehicle:
    """Who sent an autopilot's HEARTBEAT.

    Attributes
    ----------
    address : from where. system, component : MAVLink ids. autopilot : MAV_AUTOPILOT. type : MAV_TYPE.
    """

    address: str
    system: int
    component: int
    autopilot: int
    type: int

    @property
    def family(self) -> str:
        """PX4 or ARDUPILOT: the firmware whose parameters, streams and checks this vehicle has."""
        return PX4 if self.autopilot == dialect().MAV_AUTOPILOT_PX4 else ARDUPILOT

    @property
    def firmware(self) -> str:
        """The autopilot's name."""
        names = {dialect().MAV_AUTOPILOT_PX4: "PX4", dialect().MAV_AUTOPILOT_ARDUPILOTMEGA: "ArduPilot"}
        return names.get(self.autopilot, f"autopilot {self.autopilot}")

    def __str__(self) -> str:
        return f"system {self.system} ({self.firmware}) at {self.address}"


def vehicle_of(address: str, message: Message) -> Vehicle | None:
    """Whose HEARTBEAT a message from `address` is, where it is an autopilot's."""
    m = dialect()
    if message.get_type() != "HEARTBEAT" or message.autopilot == m.MAV_AUTOPILOT_INVALID:
        return None
    if message.type == m.MAV_TYPE_GCS:
        return None
    return Vehicle(address, message.get_srcSystem(), message.get_srcComponent(), message.autopilot, message.type)
