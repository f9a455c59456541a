"""A session's events as STATUSTEXT messages with ids of their own, so that any tool opens the .tlog.

The text is `mpucal ` and a JSON object; STATUSTEXT (253) holds 50 characters, and chunks of one `id` hold what is
longer. A chunk of less than 50 characters is the last one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..strict_json import parse_own_json
from .dialect import Message, dialect
from .link import OWN_COMPONENT, OWN_SYSTEM

PREFIX = b"mpucal "
CHUNK = 50
MOST_CHUNKS = 256


class Note(NamedTuple):
    """An event's name and its data, of JSON's own types."""

    name: str
    data: Mapping[str, Any]


def encode_note(note: Note, id_: int) -> list[Message]:
    """Return the messages that hold `note`.

    Parameters
    ----------
    id_ : 1 to 65535, another one than that of the note before.

    Raises
    ------
    ValueError : it holds more than STATUSTEXT can chunk.
    """
    m = dialect()
    text = PREFIX + json.dumps({"name": note.name, "data": dict(note.data)}, separators=(",", ":")).encode()
    chunks = [text[at : at + CHUNK] for at in range(0, len(text) + 1, CHUNK)]
    if len(chunks) > MOST_CHUNKS:
        raise ValueError(f"a note of {len(text)} bytes is too long for STATUSTEXT")
    return [m.MAVLink_statustext_message(m.MAV_SEVERITY_DEBUG, chunk, id_, k) for k, chunk in enumerate(chunks)]


class NoteReader:
    """Decoder of notes, which takes the messages as they come."""

    def __init__(self) -> None:
        self._id: int | None = None
        self._chunks: list[bytes] = []

    def add(self, message: Message) -> Note | None:
        """Return the note that `message` completes, None if it completes none."""
        if message.get_type() != "STATUSTEXT" or not is_own(message):
            return None
        text = message.text if isinstance(message.text, bytes) else message.text.encode()
        if message.chunk_seq == 0:
            self._id, self._chunks = message.id, []
        elif message.id != self._id or message.chunk_seq != len(self._chunks):
            self._id = None
            return None
        self._chunks.append(text)
        return _decode(b"".join(self._chunks)) if len(text) < CHUNK else None


def is_own(message: Message) -> bool:
    """Return True if the sender's ids are mpucal's."""
    return bool((message.get_srcSystem(), message.get_srcComponent()) == (OWN_SYSTEM, OWN_COMPONENT))


def _decode(text: bytes) -> Note | None:
    if not text.startswith(PREFIX):
        return None
    try:
        content = parse_own_json(text.removeprefix(PREFIX))
        return Note(str(content["name"]), dict(content["data"]))
    except (ValueError, KeyError, TypeError):
        return None
