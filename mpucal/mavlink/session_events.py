"""Events of a session in a .tlog of an earlier mpucal: STATUSTEXT messages with ids of their own.

The text is `mpucal ` and a JSON object; STATUSTEXT (253) holds 50 characters, and chunks of one `id` hold what is
longer. A chunk of less than 50 characters is the last one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ..strict_json import parse_own_json
from .dialect import Message, read_header
from .link import OWN_COMPONENT, OWN_SYSTEM

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
