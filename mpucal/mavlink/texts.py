"""Texts of mpucal in a vehicle's log (STATUSTEXT): prompts, and the events of a session of an earlier version.

A prompt is `mpucal: KIND`; where one orientation is wanted, the unit vector in the vehicle's axes that is to point down
follows: `mpucal: rotate, down +0.58 -0.58 +0.58`. The log then says what was asked, and a simulated hand obeys.

An event in a .tlog of an earlier mpucal is `mpucal ` and a JSON object. STATUSTEXT (253) holds 50 characters, and
chunks of one `id` hold what is longer; a chunk of less than 50 characters is the last one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from ..strict_json import parse_own_json
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


PREFIX = b"mpucal "
CHUNK = 50


class Note(NamedTuple):
    """An event's name and its data, of JSON's own types."""

    name: str
    data: Mapping[str, Any]


class NoteReader:
    """Decoder of notes, which takes the messages as they come."""

    def __init__(self) -> None:
        self._id: int | None = None
        self._chunks: list[bytes] = []

    def add(self, message: Message) -> Note | None:
        """Return the note that `message` completes, None if it completes none."""
        if message.get_type() != "STATUSTEXT":
            return None
        text = message.text if isinstance(message.text, bytes) else message.text.encode()
        if message.chunk_seq == 0:
            self._id, self._chunks = message.id, []
        elif message.id != self._id or message.chunk_seq != len(self._chunks):
            self._id = None
            return None
        self._chunks.append(text)
        return _decode(b"".join(self._chunks)) if len(text) < CHUNK else None


def is_own(packet: bytes) -> bool:
    """Return True if the ids of a packet's sender are mpucal's."""
    return read_header(packet)[1] == (OWN_SYSTEM, OWN_COMPONENT)


def _decode(text: bytes) -> Note | None:
    if not text.startswith(PREFIX):
        return None
    try:
        content = parse_own_json(text.removeprefix(PREFIX))
        return Note(str(content["name"]), dict(content["data"]))
    except (ValueError, KeyError, TypeError):
        return None
