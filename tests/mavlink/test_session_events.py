"""Notes of a session as STATUSTEXT chunks, as an earlier mpucal wrote them into a .tlog."""

import json
from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpucal.chip.config import RateOnlyConfig
from mpucal.chip.records import END, OPENED, SessionEvent
from mpucal.errors import EndOfCapture
from mpucal.files.tlog import read_tlog
from mpucal.mavlink.dialect import dialect
from mpucal.mavlink.link import OWN_COMPONENT, OWN_SYSTEM
from mpucal.mavlink.session_events import CHUNK, PREFIX, Note, NoteReader, is_own
from mpucal.mavlink.tlog import RawPacket, encode_tlog
from mpucal.session.plan import Plan
from mpucal.sources.packet_replay import PacketReplay

LEAVES = st.none() | st.booleans() | st.integers(-9, 9) | st.text(max_size=60)
DATA = st.dictionaries(st.text(max_size=9), LEAVES | st.lists(LEAVES, max_size=4), max_size=4)


def encode_note(note, id_):
    """Return the messages that hold a note."""
    text = PREFIX + json.dumps({"name": note.name, "data": note.data}, separators=(",", ":")).encode()
    chunks = [text[at : at + CHUNK] for at in range(0, len(text) + 1, CHUNK)]
    return [dialect().MAVLink_statustext_message(7, chunk, id_, k) for k, chunk in enumerate(chunks)]


def packed(notes):
    """Return the packets of notes."""
    sender = dialect().MAVLink(None, OWN_SYSTEM, OWN_COMPONENT)
    return [bytes(message.pack(sender)) for k, note in enumerate(notes, 1) for message in encode_note(note, k)]


def travel(messages, system=OWN_SYSTEM):
    """Return the messages packed and decoded, if they are mpucal's."""
    sender, receiver = dialect().MAVLink(None, system, OWN_COMPONENT), dialect().MAVLink(None)
    packets = [bytearray(message.pack(sender)) for message in messages]
    return [receiver.decode(packet) for packet in packets if is_own(packet)]


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
    assert not travel(encode_note(Note("key", {}), 5), system=1)
    text = dialect().MAVLink_statustext_message(6, b"mpucal: rotate", 0, 0)
    assert NoteReader().add(*travel([text])) is None


def test_a_session_of_an_earlier_version_is_read_with_its_events(station, tmp_path):
    plan = asdict(Plan(RateOnlyConfig(rate_hz=50.0), target="quick"))
    head = Note(OPENED, {"mpucal": "1.0", "source": 4, "plan": plan, "system": 7, "prepare": True})
    heartbeat = station(7).heartbeat()
    packets = [
        *packed([head]),
        heartbeat,
        *packed([Note("key", {"key": "enough"})]),
        heartbeat,
        *packed([Note(END, {})]),
    ]
    path = tmp_path / "capture.tlog"
    path.write_bytes(encode_tlog(RawPacket(k * 10**9, data) for k, data in enumerate(packets, 1)))
    capture = read_tlog(path)
    assert Plan.of_capture(capture.meta, "capture") == Plan(RateOnlyConfig(rate_hz=50.0), target="quick")
    assert (capture.meta["system"], capture.meta["prepare"]) == (7, True)
    replay = PacketReplay(capture.records, "capture")
    key = next(record for record in capture.records if record.data == {"key": "enough"})
    assert replay.receive(10**12).data == heartbeat
    assert replay.pending_events("key") == []
    assert replay.receive(key.t_ns + 1) is None
    assert replay.pending_events("key") == [SessionEvent("key", key.t_ns, {"key": "enough"})]
    assert replay.receive(10**12).data == heartbeat
    assert replay.receive(capture.records[-1].t_ns) is None
    assert [event.name for event in replay.pending_events(END)] == [END]
    with pytest.raises(EndOfCapture):
        replay.receive(10**12)


def test_the_log_of_another_station_has_no_head(station, tmp_path):
    (tmp_path / "x.tlog").write_bytes(encode_tlog([RawPacket(10**9, station(1).heartbeat())]))
    assert not read_tlog(tmp_path / "x.tlog").meta
