"""Whether a vehicle would arm, and whether it has: what it says itself."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import LinkError
from .dialect import Message, dialect
from .firmwares import PX4
from .link import Link, S

ARMED, PREARM_CHECK = 128, 0x10000000
SYS_STATUS = 1
HEARTBEAT_NS = 5 * S
COMPLAINTS_NS, TRIES = 3 * S // 2, 3
PREFIXES = ("PreArm: ", "Preflight Fail: ", "Arm: ")
# PX4 gives most of its reasons as events (EVENT, 410), whose words its component metadata holds
IN_EVENTS = "its events say why, as QGroundControl shows them"


@dataclass(frozen=True)
class PrearmState:
    """Attributes: ready, None where it does not say; complaints, its own sentences."""

    ready: bool | None
    complaints: tuple[str, ...]

    def __str__(self) -> str:
        if self.complaints:
            return "would not arm: " + "; ".join(self.complaints)
        return {True: "would arm", False: "would not arm", None: "does not say whether it would arm"}[self.ready]


class ArmingMonitor:
    """Hears HEARTBEATs from now on, whoever reads the link."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._armed: bool | None = None
        link.subscribe(self._hear)

    def _hear(self, message: Message) -> None:
        if message.get_type() == "HEARTBEAT":
            self._armed = bool(message.base_mode & ARMED)

    @property
    def armed(self) -> bool:
        """Whether it is armed; waits for the first HEARTBEAT.

        Raises
        ------
        LinkError : none comes.
        """
        if self._armed is None:
            for _ in self._link.messages(self._link.now_ns() + HEARTBEAT_NS):
                if self._armed is not None:
                    break
        if self._armed is None:
            raise LinkError(f"{self._link.vehicle} sends no heartbeat any more", "check its power and the link")
        return self._armed


def check_prearm(link: Link) -> PrearmState:
    """Have the vehicle check itself, and hear what it says.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    m, vehicle = dialect(), link.vehicle
    ready: bool | None = None
    complaints: list[str] = []
    for _ in range(TRIES):
        for number, param in ((m.MAV_CMD_RUN_PREARM_CHECKS, 0), (m.MAV_CMD_REQUEST_MESSAGE, SYS_STATUS)):
            link.send(
                link.mav.command_long_encode(vehicle.system, vehicle.component, number, 0, param, 0, 0, 0, 0, 0, 0)
            )
        for message in link.messages(link.now_ns() + COMPLAINTS_NS):
            if message.get_type() == "SYS_STATUS":
                ready = _ready(message, vehicle.family == PX4)
            if message.get_type() == "STATUSTEXT" and message.text.startswith(PREFIXES):
                complaints.append(message.text.partition(": ")[2])
        if ready is not None:
            break
    if ready is False and not complaints and vehicle.family == PX4:
        complaints.append(IN_EVENTS)
    return PrearmState(ready, tuple(dict.fromkeys(complaints)))


def _ready(message: Message, is_px4: bool) -> bool | None:
    """What a SYS_STATUS says; PX4 sets the check in `health` and never in `present`."""
    known = is_px4 or message.onboard_control_sensors_present & PREARM_CHECK
    return bool(message.onboard_control_sensors_health & PREARM_CHECK) if known else None
