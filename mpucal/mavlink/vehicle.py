"""A vehicle as its HEARTBEAT describes it."""

from __future__ import annotations

from dataclasses import dataclass

from .dialect import Message, dialect
from .firmwares import ARDUPILOT, PX4


@dataclass(frozen=True)
class Vehicle:
    """Sender of an autopilot's HEARTBEAT.

    Attributes
    ----------
    address : of its packets. system, component : MAVLink ids. autopilot : MAV_AUTOPILOT. type : MAV_TYPE.
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
        """The autopilot's name, or its number where it is neither ArduPilot nor PX4."""
        known = (dialect().MAV_AUTOPILOT_PX4, dialect().MAV_AUTOPILOT_ARDUPILOTMEGA)
        return self.family if self.autopilot in known else f"autopilot {self.autopilot}"

    def __str__(self) -> str:
        return f"system {self.system} ({self.firmware}) at {self.address}"


def vehicle_of(address: str, message: Message) -> Vehicle | None:
    """Return the sender of a message from `address` if the message is an autopilot's HEARTBEAT."""
    m = dialect()
    if message.get_type() != "HEARTBEAT" or message.autopilot == m.MAV_AUTOPILOT_INVALID:
        return None
    if message.type == m.MAV_TYPE_GCS:
        return None
    return Vehicle(address, message.get_srcSystem(), message.get_srcComponent(), message.autopilot, message.type)
