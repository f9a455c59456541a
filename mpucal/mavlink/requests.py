"""Requests to a vehicle, repeated until the answer arrives; is it armed, and would it arm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from ..clocks import S
from ..errors import LinkError
from .dialect import Message, dialect
from .firmwares import PX4
from .link import PATIENCE_NS, Link

T = TypeVar("T")


def ask(
    link: Link,
    message: Message,
    reply: Callable[[Message], T | None],
    timeout_s: float = 1.0,
    tries: int = 3,
) -> T | None:
    """Send `message` until one of the vehicle's messages is an answer.

    Parameters
    ----------
    reply : returns the answer in a message, None if it holds no answer. timeout_s : after which it is sent again.

    Returns
    -------
    The answer, or None if none came.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    for _ in range(tries):
        link.send(message)
        for received in link.messages(link.now_ns() + round(timeout_s * S)):
            answer = reply(received)
            if answer is not None:
                return answer
    return None


def encode_command(link: Link, number: int, *params: float) -> Message:
    """Return MAV_CMD `number` with up to seven parameters as COMMAND_LONG."""
    return link.encode("command_long", number, 0, *params, *[0.0] * (7 - len(params)))


def send_command(link: Link, number: int, *params: float, timeout_s: float = 1.0, tries: int = 3) -> int | None:
    """Send MAV_CMD `number` until it is acknowledged; return COMMAND_ACK's MAV_RESULT, None if none came."""

    def reply(received: Message) -> int | None:
        if received.get_type() != "COMMAND_ACK" or received.command != number:
            return None
        return None if received.result == dialect().MAV_RESULT_IN_PROGRESS else int(received.result)

    return ask(link, encode_command(link, number, *params), reply, timeout_s, tries)


# Means and attitudes of a vehicle at rest need no more.
REST_US = 20_000


def interval_command(name: str, interval_us: int = REST_US) -> tuple[int, int, int]:
    """Return the MAV_CMD that has a vehicle send the message `name` each `interval_us`, and its parameters."""
    m = dialect()
    return m.MAV_CMD_SET_MESSAGE_INTERVAL, getattr(m, f"MAVLINK_MSG_ID_{name}"), interval_us


COMPLAINTS_NS, TRIES = 3 * S // 2, 3
PREFIXES = ("PreArm: ", "Preflight Fail: ", "Arm: ")
# PX4 gives most of its reasons as events (EVENT, 410), whose words are in its component metadata.
IN_EVENTS = "its events say why, as QGroundControl shows them"
WITHOUT_REASON = "would not arm, and gives no reason: see the messages in its ground station"


@dataclass(frozen=True)
class PrearmState:
    """Result of a vehicle's pre-arm check.

    Attributes
    ----------
    ready : None if the vehicle does not say. complaints : its own sentences.
    """

    ready: bool | None
    complaints: tuple[str, ...]

    def __str__(self) -> str:
        if self.complaints:
            return "would not arm: " + "; ".join(self.complaints)
        return {True: "would arm", False: WITHOUT_REASON, None: "does not say whether it would arm"}[self.ready]


def is_armed(link: Link) -> bool:
    """Return True if the vehicle is armed; wait for its first HEARTBEAT.

    Raises
    ------
    LinkError : none comes. EndOfCapture : see Link.messages.
    """
    if link.armed is None and all(link.armed is None for _ in link.messages(link.now_ns() + PATIENCE_NS)):
        raise LinkError(f"{link.vehicle} sends no heartbeat any more", "check its power and the link")
    return bool(link.armed)


def check_prearm(link: Link) -> PrearmState:
    """Have the vehicle run its pre-arm checks, and collect its answers.

    Raises
    ------
    EndOfCapture, LinkError : see Link.messages.
    """
    m, is_px4 = dialect(), link.vehicle.family == PX4
    ready: bool | None = None
    complaints: list[str] = []
    for _ in range(TRIES):
        link.send(encode_command(link, m.MAV_CMD_RUN_PREARM_CHECKS))
        link.send(encode_command(link, m.MAV_CMD_REQUEST_MESSAGE, m.MAVLINK_MSG_ID_SYS_STATUS))
        for message in link.messages(link.now_ns() + COMPLAINTS_NS):
            if message.get_type() == "SYS_STATUS":
                ready = _is_ready(message, is_px4)
            if message.get_type() == "STATUSTEXT" and message.text.startswith(PREFIXES):
                complaints.append(message.text.partition(": ")[2])
        if ready or (ready is False and (complaints or is_px4)):
            break  # else an answer, or its reasons, got lost
    if ready is False and not complaints and is_px4:
        complaints.append(IN_EVENTS)
    return PrearmState(ready, tuple(dict.fromkeys(complaints)))


def _is_ready(message: Message, is_px4: bool) -> bool | None:
    """Return the state in a SYS_STATUS, None if it lacks the check; PX4 never lists it as present."""
    check = dialect().MAV_SYS_STATUS_PREARM_CHECK
    known = is_px4 or message.onboard_control_sensors_present & check
    return bool(message.onboard_control_sensors_health & check) if known else None
