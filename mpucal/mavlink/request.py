"""A message to a vehicle and its answer, asked for again where one of them is lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from .dialect import Message, dialect
from .link import Link, S

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
    reply : what a message answers, None where it is no answer. timeout_s : after which it is sent again.

    Returns
    -------
    The answer, or None where none came.

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


def send_command(link: Link, number: int, *params: float, timeout_s: float = 1.0, tries: int = 3) -> int | None:
    """Send MAV_CMD `number` as COMMAND_LONG; the MAV_RESULT of its COMMAND_ACK, None where none came."""
    seven = [*params, *[0.0] * (7 - len(params))]
    vehicle = link.vehicle
    message = link.mav.command_long_encode(vehicle.system, vehicle.component, number, 0, *seven)

    def reply(received: Message) -> int | None:
        if received.get_type() != "COMMAND_ACK" or received.command != number:
            return None
        return None if received.result == dialect().MAV_RESULT_IN_PROGRESS else int(received.result)

    return ask(link, message, reply, timeout_s, tries)
