"""Requests to a vehicle, which are repeated until the answer arrives."""

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
