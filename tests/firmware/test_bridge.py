"""Core's replies to every request, and the tables of its headers, against firmware_protocol.md."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.bridge import messages as wire
from mpucal.bridge.frame import Deframer, Frame
from mpucal.bridge.messages import Status

ROOT = Path(__file__).parents[2]
VECTORS = ROOT / "fixtures" / "vectors"
DOCUMENT = (ROOT / "firmware_protocol.md").read_text()
HEADERS = "".join(
    (ROOT / "mpucal" / "firmware" / "src" / f"mpucal_{name}.h").read_text() for name in ("protocol", "frame")
)
BLOB = (VECTORS / "blob_measured.bin").read_bytes()
OTHER = (VECTORS / "blob_appended.bin").read_bytes()
CRC = int.from_bytes(BLOB[-4:], "little")


@dataclass
class Chip:
    """Registers at one address; reads return increasing bytes."""

    address: int = 0x68
    failure: int = 0
    written: list[tuple[int, bytes]] = field(default_factory=list)

    def read(self, address, first, count):
        if address != self.address:
            return Status.NO_ANSWER, b""
        return self.failure, bytes((first + i) & 0xFF for i in range(count))

    def write(self, address, first, data):
        if address != self.address:
            return Status.NO_ANSWER
        self.written.append((first, data))
        return self.failure


class Asking:
    """Bridge with the requests of a host."""

    def __init__(self, host, core, chip, eeprom):
        self.chip, self.eeprom = chip, eeprom
        self.bridge = host.HostBridge(core, eeprom, chip.read, chip.write)

    def frames(self, data):
        return list(Deframer().feed(self.bridge.receive(data)))

    def raw(self, kind, payload=b"", seq=5):
        return [
            wire.answer_of(frame.type, frame.payload)
            for frame in self.frames(Frame(kind, seq, payload).encode())
            if (frame.type, frame.seq) == (kind | wire.REPLY_BIT, seq)
        ]

    def ask(self, request):
        (answer,) = self.raw(request.TYPE, request.payload())
        return answer

    def store(self, blob):
        self.ask(wire.BlobBegin(len(blob)))
        for offset in range(0, len(blob), wire.MAX_CHUNK):
            assert self.ask(wire.BlobData(offset, blob[offset : offset + wire.MAX_CHUNK])).status == Status.OK
        return self.ask(wire.BlobCommit(len(blob), int.from_bytes(blob[-4:], "little")))

    def stored(self):
        state = self.ask(wire.BlobState())
        if state.status == Status.NO_BLOB:
            return None
        pieces = range(0, state.length, wire.MAX_READ)
        counts = [min(wire.MAX_READ, state.length - offset) for offset in pieces]
        return b"".join(
            self.ask(wire.BlobRead(offset, count)).data for offset, count in zip(pieces, counts, strict=True)
        )


@pytest.fixture
def fresh(host, core):
    return Asking(host, core, Chip(), host.Eeprom())


@pytest.fixture
def bridge(fresh):
    fresh.ask(wire.Hello())
    return fresh


@pytest.mark.parametrize("kind", [0x02, 0x05, 0x10, 0x14, 0x33], ids=hex)
def test_before_hello_every_request_is_told_so(kind, fresh):
    (frame,) = fresh.frames(Frame(kind, 5).encode())
    assert (frame.type, frame.seq, frame.payload[0]) == (kind | wire.REPLY_BIT, 5, Status.NO_HELLO)


def test_hello_says_who_it_is(fresh):
    fresh.bridge.now_us = 0x89ABCDEF
    answer = fresh.ask(wire.Hello())
    assert answer == wire.HelloReply(
        status=0,
        t_us=0x89ABCDEF,
        magic=b"MPUB",
        major=1,
        minor=0,
        address=0x68,
        features=wire.Feature.STREAM | wire.Feature.BLOB,
        window=3,
        blob_bytes=256,
        name=b"core on a host".ljust(16, b"\0"),
    )


@pytest.mark.parametrize(
    ("at", "asked", "found"), [(0x68, 0, 0x68), (0x69, 0, 0x69), (0x69, 0x69, 0x69), (0x69, 0x68, 0), (0x20, 0, 0)]
)
def test_hello_looks_for_the_chip(at, asked, found, fresh):
    fresh.chip.address = at
    assert fresh.ask(wire.Hello(address=asked)).address == found


@pytest.mark.parametrize(
    "payload",
    [b"", b"MPUB\1", b"MPUX\1\0\0", b"MPUB\1\0", b"MPUB\1\0\x80"],
    ids=["none", "cut", "magic", "no address", "address"],
)
def test_a_hello_that_is_none_changes_nothing(payload, fresh):
    assert [answer.status for answer in fresh.raw(wire.Hello.TYPE, payload)] == [Status.BAD_PAYLOAD]
    assert fresh.ask(wire.Read(0x75, 1)).status == Status.NO_HELLO


@pytest.mark.parametrize("count", [1, 14, 56])
def test_reads_registers(count, bridge):
    bridge.bridge.now_us = 1234
    assert bridge.ask(wire.Read(0x3B, count)) == wire.ReadReply(0, 1234, bytes(range(0x3B, 0x3B + count)))


@pytest.mark.parametrize("count", [1, 56, 57, 112, 500, 4096])
def test_a_burst_comes_in_pieces(count, bridge):
    answers = bridge.raw(wire.Burst.TYPE, wire.Burst(0x74, count).payload())
    assert [answer.offset for answer in answers] == list(range(0, count, 56))
    assert [len(answer.data) for answer in answers] == [min(56, count - at) for at in range(0, count, 56)]


def test_a_burst_ends_where_a_transfer_fails(bridge):
    bridge.chip.failure = Status.BUS_FAILED
    answers = bridge.raw(wire.Burst.TYPE, wire.Burst(0x74, 500).payload())
    assert [answer.status for answer in answers] == [Status.BUS_FAILED]


@pytest.mark.parametrize("data", [b"\x80", bytes(32)], ids=len)
def test_writes_registers(data, bridge):
    del bridge.chip.written[:]
    assert bridge.ask(wire.Write(0x6B, data)).status == Status.OK
    assert bridge.chip.written == [(0x6B, data)]


@pytest.mark.parametrize("code", [Status.NO_ANSWER, Status.BUS_FAILED])
def test_a_transfer_that_failed_says_how(code, bridge):
    bridge.chip.failure = code
    assert [bridge.ask(wire.Read(0, 1)).status, bridge.ask(wire.Write(0, b"\0")).status] == [code, code]


BAD_PAYLOADS = {
    "read nothing": (0x02, b"\x75\0"),
    "read too much": (0x02, b"\x75\x39"),
    "read cut": (0x02, b"\x75"),
    "burst nothing": (0x03, b"\x74\0\0"),
    "burst too much": (0x03, b"\x74\x01\x10"),
    "burst cut": (0x03, b"\x74\x01"),
    "write nothing": (0x04, b"\x6b"),
    "write too much": (0x04, bytes(34)),
    "write cut": (0x04, b""),
    "stream too long": (0x05, b"\x39\x01"),
    "stream no batch": (0x05, b"\x0e\0"),
    "stream batch": (0x05, b"\x0e\x21"),
    "stream cut": (0x05, b"\x0e"),
    "blob read nothing": (0x11, b"\0\0\0"),
    "blob read too much": (0x11, b"\0\0\x39"),
    "blob read cut": (0x11, b"\0\0"),
    "begin cut": (0x12, b"\0"),
    "data nothing": (0x13, b"\0\0"),
    "data too much": (0x13, bytes(35)),
    "commit cut": (0x14, bytes(5)),
}


@pytest.mark.parametrize(("kind", "payload"), BAD_PAYLOADS.values(), ids=BAD_PAYLOADS)
def test_a_payload_out_of_its_limits_is_refused(kind, payload, bridge):
    del bridge.chip.written[:]
    assert [answer.status for answer in bridge.raw(kind, payload)] == [Status.BAD_PAYLOAD]
    assert (bridge.chip.written, bridge.eeprom.writes) == ([], 0)


def test_bytes_behind_the_fields_it_knows_are_ignored(bridge):
    answers = bridge.raw(wire.Read.TYPE, wire.Read(0x75, 1).payload() + b"later")
    assert answers == [wire.ReadReply(0, 0, b"\x75")]


def test_unknown_requests_are_told_so_and_replies_ignored(bridge):
    assert [bridge.frames(Frame(kind, 1).encode()) for kind in range(0x80, 0x100)] == [[]] * 0x80
    unknown = [kind for kind in range(0x80) if kind not in wire.REQUESTS]
    frames = [bridge.frames(Frame(kind, 1).encode())[0] for kind in unknown]
    assert {frame.payload[0] for frame in frames} == {Status.UNKNOWN_TYPE}
    assert [frame.type for frame in frames] == [kind | wire.REPLY_BIT for kind in unknown]


def test_a_blob_is_stored_read_and_replaced(bridge):
    assert bridge.stored() is None
    assert bridge.ask(wire.BlobRead(0, 1)).status == Status.NO_BLOB
    for generation, blob in enumerate((BLOB, OTHER, BLOB), 1):
        assert bridge.store(blob) == wire.BlobCommitReply(0, 0, generation)
        state = bridge.ask(wire.BlobState())
        assert (state.generation, state.length, state.crc) == (
            generation,
            len(blob),
            int.from_bytes(blob[-4:], "little"),
        )
        assert bridge.stored() == blob


def test_until_commit_the_old_blob_counts_and_hello_gives_the_new_one_up(bridge):
    bridge.store(OTHER)
    bridge.ask(wire.BlobBegin(len(BLOB)))
    bridge.ask(wire.BlobData(0, BLOB[:32]))
    assert bridge.stored() == OTHER
    bridge.ask(wire.Hello())
    assert bridge.ask(wire.BlobData(32, BLOB[32:64])).status == Status.NOT_BEGUN
    assert bridge.stored() == OTHER


def test_repeats_of_blob_messages_do_no_harm(bridge):
    for _ in range(2):
        assert bridge.ask(wire.BlobBegin(len(BLOB))).status == Status.OK
    for offset in range(0, len(BLOB), 32):
        for _ in range(2):
            assert bridge.ask(wire.BlobData(offset, BLOB[offset : offset + 32])).status == Status.OK
    commit = wire.BlobCommit(len(BLOB), CRC)
    assert [bridge.ask(commit).generation for _ in range(3)] == [1, 1, 1]


@pytest.mark.parametrize("name", [*sorted(path.stem for path in VECTORS.glob("blob_bad_*.bin")), "blob_not_finite"])
def test_what_is_no_blob_leaves_the_old_one(name, bridge):
    bridge.store(OTHER)
    bad = (VECTORS / f"{name}.bin").read_bytes()
    assert bridge.store(bad).status == Status.BAD_BLOB
    assert bridge.stored() == OTHER
    assert bridge.store(BLOB).status == Status.OK


OUT_OF_ORDER = {
    "data before begin": ([wire.BlobData(0, b"x")], Status.NOT_BEGUN),
    "commit before begin": ([wire.BlobCommit(188, 0)], Status.NOT_BEGUN),
    "too long": ([wire.BlobBegin(257)], Status.NO_ROOM),
    "a gap": ([wire.BlobBegin(188), wire.BlobData(1, b"x")], Status.BAD_OFFSET),
    "beyond the end": ([wire.BlobBegin(3), wire.BlobData(0, b"abcd")], Status.BAD_OFFSET),
    "far beyond": ([wire.BlobBegin(3), wire.BlobData(0xFFFF, b"abcd")], Status.BAD_OFFSET),
    "read beyond": ([wire.BlobRead(0xFFFF, 56)], Status.BAD_OFFSET),
    "read over the end": ([wire.BlobRead(187, 2)], Status.BAD_OFFSET),
}


@pytest.mark.parametrize(("requests", "status"), OUT_OF_ORDER.values(), ids=OUT_OF_ORDER)
def test_blob_messages_out_of_order_are_refused(requests, status, bridge):
    bridge.store(BLOB)
    assert [bridge.ask(request).status for request in requests][-1] == status
    assert bridge.stored() == BLOB


def test_erase_leaves_none(bridge):
    bridge.store(OTHER)
    bridge.store(BLOB)
    assert bridge.ask(wire.BlobErase()).status == Status.OK
    assert bridge.stored() is None


def test_a_memory_that_does_not_keep_its_bytes_is_told(bridge):
    bridge.eeprom.stuck.update(range(1024))
    assert bridge.ask(wire.BlobBegin(188)).status == Status.OK
    assert bridge.ask(wire.BlobData(0, BLOB[:32])).status == Status.STORAGE_FAILED


requests = st.one_of(
    st.binary(max_size=90),
    st.builds(Frame, st.sampled_from([*wire.REQUESTS]), st.integers(0, 255), st.binary(max_size=66)).map(Frame.encode),
    st.builds(wire.BlobBegin, st.integers(0, 300)).map(lambda it: Frame(it.TYPE, 1, it.payload()).encode()),
    st.builds(wire.BlobData, st.integers(0, 300), st.binary(min_size=1, max_size=32)).map(
        lambda it: Frame(it.TYPE, 1, it.payload()).encode()
    ),
    st.builds(wire.Stream, st.integers(0, 56), st.integers(1, 32)).map(
        lambda it: Frame(it.TYPE, 1, it.payload()).encode()
    ),
)


@settings(max_examples=300)
@given(told=st.lists(requests, max_size=30))
def test_whatever_comes_it_sends_nothing_but_answers_and_keeps_its_blob(told, host, core):
    asking = Asking(host, core, Chip(), host.Eeprom())
    asking.ask(wire.Hello())
    asking.store(BLOB)
    for data in told:
        sent = asking.bridge.receive(data + b"\0")
        asking.bridge.now_us += 700
        deframer = Deframer()
        for frame in deframer.feed(sent + asking.bridge.look()):
            wire.answer_of(frame.type, frame.payload)
        assert deframer.rejected == 0
    # an ERASE and a whole BEGIN, DATA, COMMIT are within what may come, another blob is not
    assert asking.stored() in (BLOB, None)


# The document's tables and the headers'.


def rows(heading):
    section = DOCUMENT.split(f"### {heading}\n")[1].split("\n### ")[0].split("\n#### ")[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines() if line[:1] == "|"][
        2:
    ]


def constant(name):
    (value,) = re.findall(rf"\bMPUCAL_{name} ?=? (0x[0-9A-F]+|\d+)\b", HEADERS)
    return int(value, 0)


def test_types_are_the_documents():
    requests = {name: int(kind, 0) for kind, name, *_ in rows("Messages") if kind.startswith("0x") and " " not in kind}
    assert requests == {name: constant(name) for name in requests}
    assert len(requests) == len(wire.REQUESTS) + 1


def test_status_codes_are_the_documents():
    codes = {name: int(code) for code, name, _ in rows("Status codes")}
    assert codes == {name: constant(f"CODE_{name}") for name in codes}
    assert len(codes) == len(Status)


def test_limits_are_the_documents():
    limits = {name: int(value) for name, value, _ in rows("Limits")}
    assert limits == {name: constant(name) for name in limits}
    assert constant("BEAT_MS") == next(int(value) for name, value, _ in rows("Timing") if name == "BEAT_MS")
