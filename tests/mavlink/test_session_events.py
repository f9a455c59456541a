"""Notes of a session as STATUSTEXT chunks."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.link import OWN_COMPONENT, OWN_SYSTEM
from mpucal.mavlink.session_events import Note, NoteReader, encode_note

LEAVES = st.none() | st.booleans() | st.integers(-9, 9) | st.text(max_size=60)
DATA = st.dictionaries(st.text(max_size=9), LEAVES | st.lists(LEAVES, max_size=4), max_size=4)


def travel(messages, system=OWN_SYSTEM):
    """Return the messages packed and decoded."""
    sender, receiver = dialect().MAVLink(None, system, OWN_COMPONENT), dialect().MAVLink(None)
    return [receiver.decode(bytearray(message.pack(sender))) for message in messages]


@given(name=st.text(max_size=80), data=DATA, id_=st.integers(1, 65535))
def test_a_note_comes_back_whole(name, data, id_):
    note = Note(name, data)
    notes = NoteReader()
    found = [notes.add(message) for message in travel(encode_note(note, id_))]
    assert found[-1] == note
    assert found[:-1] == [None] * (len(found) - 1)


def test_a_note_that_misses_a_chunk_is_none():
    first, _, *rest = travel(encode_note(Note("key", {"text": "x" * 200}), 5))
    notes = NoteReader()
    assert [notes.add(message) for message in (first, *rest)] == [None] * (1 + len(rest))


def test_others_notes_and_other_text_of_ours_are_none():
    assert NoteReader().add(*travel(encode_note(Note("key", {}), 5), system=1)) is None
    text = dialect().MAVLink_statustext_message(6, b"mpucal: rotate", 0, 0)
    assert NoteReader().add(*travel([text])) is None


def test_a_note_too_long_is_refused():
    with pytest.raises(ValueError, match="too long"):
        encode_note(Note("key", {"text": "x" * 20_000}), 1)
