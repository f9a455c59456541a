"""Prompts of mpucal in a vehicle's log, as STATUSTEXT.

A prompt is `mpucal: KIND`; where one orientation is wanted, the unit vector in the vehicle's axes that is to point down
follows: `mpucal: rotate, down +0.58 -0.58 +0.58`. The log then says what was asked, and a simulated hand obeys.
"""

from __future__ import annotations

import re
from typing import NamedTuple, Protocol

from .dialect import Message, dialect, read_header
from .link import OWN_COMPONENT, OWN_SYSTEM

_TEXT = re.compile(r"mpucal: ([a-z_]{1,16})(?:, down ([+-]\d\.\d{2}) ([+-]\d\.\d{2}) ([+-]\d\.\d{2}))?")

Direction = tuple[float, float, float]


class Prompt(Protocol):
    """A session's instruction to the operator; see session.events.Prompt."""

    @property
    def kind(self) -> str: ...  # noqa: D102

    @property
    def down(self) -> Direction | None: ...  # noqa: D102


class ReceivedPrompt(NamedTuple):
    """A prompt as the vehicle receives it: its kind, and the unit vector to point down, if one is wanted."""

    kind: str
    down: Direction | None


def encode_prompt(prompt: Prompt) -> Message:
    """Return the STATUSTEXT that holds the prompt."""
    m = dialect()
    down = "" if prompt.down is None else ", down {:+.2f} {:+.2f} {:+.2f}".format(*prompt.down)
    return m.MAVLink_statustext_message(m.MAV_SEVERITY_INFO, f"mpucal: {prompt.kind}{down}".encode())


def decode_prompt(message: Message) -> ReceivedPrompt | None:
    """Return the prompt in a message, None if it holds none."""
    if message.get_type() != "STATUSTEXT":
        return None
    found = _TEXT.fullmatch(message.text)
    if found is None:
        return None
    kind, *down = found.groups()
    return ReceivedPrompt(kind, None if down[0] is None else (float(down[0]), float(down[1]), float(down[2])))


def is_own(packet: bytes) -> bool:
    """Return True if the ids of a packet's sender are mpucal's."""
    return read_header(packet)[1] == (OWN_SYSTEM, OWN_COMPONENT)
