import json
import re
import struct
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.bridge import frame, messages
from mpucal.bridge.frame import Frame
from mpucal.bridge.messages import (
    ANSWERS,
    REPLY_BIT,
    REQUESTS,
    Frames,
    MessageError,
    ReadReply,
    Reply,
    Status,
    answer_of,
)

PROJECT = Path(__file__).parents[2]
VECTORS = PROJECT / "fixtures" / "vectors"
PROTOCOL = (PROJECT / "firmware_protocol.md").read_text().split("\n## The config blob\n")[0]
KINDS = {kind.__name__: kind for kind in (*REQUESTS.values(), *ANSWERS.values())}
LINES = {path.stem: json.loads(path.read_text()) for path in sorted(VECTORS.glob("line_*.json"))}
MEANT = {name: document for name, document in LINES.items() if "message" in document}


def section(title, level="###"):
    """The text under a heading, down to the next one of its level or above."""
    text = PROTOCOL.split(f"\n{level} {title}\n", 1)[1]
    return re.split(rf"^#{{2,{len(level)}}} ", text, maxsplit=1, flags=re.M)[0]


def rows(text):
    """The cells of the rows of a table."""
    lines = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line] for line in lines[2:]]


def upper(name):
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).upper()


def values(kind, draw):
    """Draw values for the fields of a message."""
    sizes = re.findall(r"(\d*)([A-Za-z])", kind.FORMAT.format)
    limits = {"B": 0xFF, "H": 0xFFFF, "I": 0xFFFFFFFF}
    made = []
    for count, code in sizes:
        made.append(
            draw(st.binary(min_size=int(count), max_size=int(count)) if code == "s" else st.integers(0, limits[code]))
        )
    if kind.TAIL:
        made.append(draw(st.binary(max_size=frame.MAX_PAYLOAD - kind.FORMAT.size)))
    return made


@settings(max_examples=100)
@given(kind=st.sampled_from([*KINDS.values()]), data=st.data(), appended=st.binary(min_size=1, max_size=8))
def test_decode_is_the_inverse_of_payload_and_skips_what_a_newer_minor_version_appends(kind, data, appended):
    message = kind(*values(kind, data.draw))
    payload = message.payload()
    assert kind.decode(payload) == message
    for size in range(kind.FORMAT.size):
        with pytest.raises(MessageError, match="too short for"):
            kind.decode(payload[:size])
    if not kind.TAIL:
        assert kind.decode(payload + appended) == message


@given(st.integers(0, 255), st.binary(max_size=frame.MAX_PAYLOAD))
def test_an_answer_is_one_or_an_error(kind, payload):
    try:
        answer = answer_of(kind, payload)
    except MessageError:
        return
    assert answer.payload() == payload[: len(answer.payload())]


def test_a_failed_reply_may_end_after_its_time():
    payload = struct.pack("<BI", Status.NO_ANSWER, 99)
    assert answer_of(0x81, payload) == Reply(Status.NO_ANSWER, 99)
    assert answer_of(ReadReply.TYPE, payload) == ReadReply(Status.NO_ANSWER, 99, b"")
    with pytest.raises(MessageError):
        answer_of(0x81, struct.pack("<BI", Status.OK, 99))


def test_golden_vectors():
    for name, document in MEANT.items():
        (content,) = document["frames"]
        payload = bytes.fromhex(content["payload"])
        known = REQUESTS.get(content["type"])
        message = known.decode(payload) if known else answer_of(content["type"], payload)
        assert type(message).__name__ == document["message"], name
        assert message.payload() == payload, name
        for key, value in document["values"].items():
            held = getattr(message, key)
            if isinstance(held, bytes):
                held = held.rstrip(b"\0").decode() if key in ("magic", "name") else held.hex()
            assert held == value, (name, key)


# The document and the codec


def test_the_documents_list_of_messages_is_the_codecs():
    listed = {
        int(cells[0], 16): cells[1]
        for cells in rows(section("Messages").split("####")[0])
        if " to " not in cells[0] and cells[0].startswith("0x")
    }
    assert listed == {kind.TYPE: upper(kind.__name__) for kind in (*REQUESTS.values(), Frames)}
    assert {kind | REPLY_BIT for kind in REQUESTS} | {Frames.TYPE} == set(ANSWERS)
    for kind in REQUESTS.values():
        assert ANSWERS[kind.TYPE | REPLY_BIT].__name__ == kind.__name__ + "Reply"


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_the_documents_table_is_the_codecs_format(kind):
    text = section(upper(kind.__name__), "####")
    table = rows(text)
    if not kind.FORMAT.size:
        assert "No payload." in text
    codes = {"u8": "B", "u16": "H", "u32": "I"}
    expected, names, at, tail = "<", [], 0, False
    for where, name, form, *_ in table:
        first, _, last = where.partition("-")
        assert int(first) == at, name
        names.append(name)
        if form == "u8[]":
            assert not last
            tail = True
            continue
        size = re.fullmatch(r"char\[(\d+)\]", form)
        code = f"{size[1]}s" if size else codes[form]
        assert int(last or first) - at + 1 == struct.calcsize("<" + code), name
        expected, at = f"{expected} {code}", int(last or first) + 1
    assert expected.replace("< ", "<") == kind.FORMAT.format
    assert names == [field.name for field in fields(kind)]
    assert tail == kind.TAIL


def test_the_documents_other_tables_are_the_codecs():
    titles = re.findall(r"^#### (\w+)$", PROTOCOL, re.M)
    assert sorted(titles) == sorted(upper(name) for name in KINDS)
    assert {cells[1]: int(cells[0]) for cells in rows(section("Status codes"))} == {s.name: s.value for s in Status}
    limits = {cells[0]: int(cells[1]) for cells in rows(section("Limits"))}
    assert limits == {name: getattr(messages, name, None) or getattr(frame, name) for name in limits}
    assert len(limits) == 10


def test_the_documents_example_is_what_goes_over_the_line():
    text = section("Example")
    lines = re.findall(r"^    (host|bridge) +(\w+) +([0-9a-f ]+(?:\n {20,}[0-9a-f ]+)*)$", text, re.M)
    assert len(lines) == 12
    for who, name, data in lines:
        assert bytes.fromhex(data) == (VECTORS / f"line_{name}.bin").read_bytes(), name
        assert (who == "bridge") == bool(Frame.decode(bytes.fromhex(data)[:-1]).type & REPLY_BIT)
