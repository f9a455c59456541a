"""Rules of firmware_protocol.md, held by both bridges: the core of the firmware, and the program for MicroPython."""

import ctypes
import errno
import json
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.bridge import board
from mpucal.bridge import messages as wire
from mpucal.bridge.doctor import examine_conformance, exchanges, find_difference
from mpucal.bridge.frame import Deframer, Frame
from mpucal.bridge.messages import Status
from mpucal.bridge.store import BlobStore
from mpucal.doctor.finding import Mark

VECTORS = Path(__file__).parents[2] / "fixtures" / "vectors"
BLOB = (VECTORS / "blob_measured.bin").read_bytes()
OTHER = (VECTORS / "blob_appended.bin").read_bytes()
CRC = int.from_bytes(BLOB[-4:], "little")


class Chip:
    """Registers at one address, for the buses of both bridges; reads return increasing bytes, FIFO_COUNT 504.

    Attributes
    ----------
    failure : status of every transfer. number : of the error that MicroPython raises for it.
    """

    def __init__(self, address=0x68):
        self.address, self.failure, self.number, self.written = address, Status.OK, errno.EIO, []

    def read(self, address, first, count):
        if address == 0:  # the general call
            return Status.BUS_FAILED, b""
        if address != self.address:
            return Status.NO_ANSWER, b""
        increasing = bytes((first + i) & 0xFF for i in range(count))
        return self.failure, b"\x01\xf8" if (first, count) == (0x72, 2) else increasing

    def write(self, address, first, data):
        self.written.append((first, data))
        return self.read(address, first, 1)[0]

    # machine.I2C

    def readfrom(self, address, count):
        return self._or_error(*self.read(address, 0, count), probing=True)

    def readfrom_mem(self, address, register, count):
        return self._or_error(*self.read(address, register, count))

    def writeto_mem(self, address, register, data):
        self._or_error(self.write(address, register, data), b"")

    def _or_error(self, status, data, probing=False):
        # a transfer that broke off looks like a missing acknowledge, but the chip is still there
        if status and not (probing and (status, self.number) == (Status.BUS_FAILED, errno.EIO)):
            raise OSError(self.number)
        return data


class Asking:
    """Host's requests to a bridge; `said` takes bytes and returns those of the bridge."""

    def __init__(self, said, chip):
        self.said, self.chip = said, chip

    def frames(self, data):
        return list(Deframer().feed(self.said(data)))

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
        pieces = [(at, min(wire.MAX_READ, state.length - at)) for at in range(0, state.length, wire.MAX_READ)]
        return b"".join(self.ask(wire.BlobRead(*piece)).data for piece in pieces)


@pytest.fixture(scope="session")
def on_core(host, core):
    """Makes a bridge of the firmware's core, with an EEPROM."""

    def make(chip=None, eeprom=None):
        chip, eeprom = chip or Chip(), eeprom or host.Eeprom()
        asking = Asking(host.HostBridge(core, eeprom, chip.read, chip.write).receive, chip)
        asking.eeprom = eeprom
        return asking

    return make


def on_micropython(folder, chip):
    """Make a bridge of the program for MicroPython, with files in a folder."""
    bridge = board.Bridge([chip], lambda: 0, f"{folder}/")

    def said(data):
        bridge.receive(data)
        return bridge.work()

    asking = Asking(said, chip)
    asking.files = bridge.files
    return asking


@pytest.fixture(params=["core", "MicroPython"])
def fresh(request, tmp_path):
    if request.param == "core":
        return request.getfixturevalue("on_core")()
    return on_micropython(tmp_path, Chip())


@pytest.fixture
def bridge(fresh):
    fresh.ask(wire.Hello())
    return fresh


def test_answers_as_the_golden_exchanges_say(fresh):
    for name, exchange in exchanges().items():
        fresh.ask(wire.Hello())
        for step in exchange["steps"]:
            assert find_difference(step, fresh.frames(bytes.fromhex(step["host"]))) == "", name
        fresh.ask(wire.Hello())
        fresh.ask(wire.BlobErase())


def test_requests_before_hello_are_refused(fresh):
    for kind in (0x02, 0x05, 0x10, 0x14, 0x33):
        (frame,) = fresh.frames(Frame(kind, 5).encode())
        assert (frame.type, frame.seq, frame.payload[0]) == (kind | wire.REPLY_BIT, 5, Status.NO_HELLO)


@pytest.mark.parametrize(
    ("at", "asked", "found"), [(0x68, 0, 0x68), (0x69, 0, 0x69), (0x69, 0x69, 0x69), (0x69, 0x68, 0), (0x20, 0, 0)]
)
def test_hello_says_who_it_is_and_looks_for_the_chip(at, asked, found, fresh):
    fresh.chip.address = at
    answer = fresh.ask(wire.Hello(address=asked))
    assert (answer.status, answer.magic, answer.major, answer.address) == (Status.OK, b"MPUB", 1, found)
    assert (answer.features & ~wire.Feature.LEAVE, answer.blob_bytes) == (wire.Feature.STREAM | wire.Feature.BLOB, 256)


def test_registers_are_read_and_written(bridge):
    del bridge.chip.written[:]
    for count in (1, 14, 56):
        assert bridge.ask(wire.Read(0x3B, count)).data == bytes(range(0x3B, 0x3B + count))
    for data in (b"\x80", bytes(32)):
        assert bridge.ask(wire.Write(0x6B, data)).status == Status.OK
        assert bridge.chip.written.pop() == (0x6B, data)
    for count in (1, 56, 57, 500, 4096):
        answers = bridge.raw(wire.Burst.TYPE, wire.Burst(0x74, count).payload())
        assert [answer.offset for answer in answers] == list(range(0, count, 56))
        assert [len(answer.data) for answer in answers] == [min(56, count - at) for at in range(0, count, 56)]
    # bytes behind the fields that it knows are ignored
    assert [answer.data for answer in bridge.raw(wire.Read.TYPE, wire.Read(0x75, 1).payload() + b"later")] == [b"\x75"]


@pytest.mark.parametrize(
    ("code", "number"),
    [(Status.NO_ANSWER, errno.EIO), (Status.BUS_FAILED, errno.EIO), (Status.BUS_FAILED, errno.ETIMEDOUT)],
)
def test_a_transfer_that_failed_says_how(code, number, bridge):
    bridge.chip.failure, bridge.chip.number = code, number
    assert [bridge.ask(wire.Read(0, 1)).status, bridge.ask(wire.Write(0, b"\0")).status] == [code, code]
    assert [answer.status for answer in bridge.raw(wire.Burst.TYPE, wire.Burst(0x74, 500).payload())] == [code]


# of each request: payloads that ask for nothing or for too much, and shorter ones than its fields
BAD_PAYLOADS = {
    "read": (0x02, b"\x75\0", b"\x75\x39", b"\x75"),
    "burst": (0x03, b"\x74\0\0", b"\x74\x01\x10", b"\x74\x01"),
    "write": (0x04, b"\x6b", bytes(34), b""),
    "stream": (0x05, b"\x39\x01", b"\x0e\0", b"\x0e\x21", b"\x0e"),
    "read of a blob": (0x11, b"\0\0\0", b"\0\0\x39", b"\0\0"),
    "begin": (0x12, b"\0"),
    "data": (0x13, b"\0\0", bytes(35)),
    "commit": (0x14, bytes(5)),
}


@pytest.mark.parametrize("program", ["core", "MicroPython"])
def test_frames_that_were_read_before_a_transfer_failed_are_pushed(program, host, core, tmp_path):
    class Dying(Chip):
        fifo_reads = 0

        def read(self, address, first, count):
            self.fifo_reads += first == 0x74
            return (Status.NO_ANSWER, b"") if self.fifo_reads > 2 else super().read(address, first, count)

    chip = Dying()
    bridge = on_micropython(tmp_path, chip)
    if program == "core":
        made = host.HostBridge(core, host.Eeprom(), chip.read, chip.write)

        def told(data):
            said = made.receive(data)
            for _ in range(3):  # a message each
                made.now_us += 1000
                said += made.look()
            return said

        bridge = Asking(told, chip)
    bridge.ask(wire.Hello())
    answers = [
        wire.answer_of(frame.type, frame.payload)
        for frame in bridge.frames(Frame(wire.Stream.TYPE, 5, wire.Stream(14, 4).payload()).encode())
    ]
    pushed = [each for each in answers if isinstance(each, wire.Frames)]
    said = [(each.status, each.index, each.drops, len(each.frames)) for each in pushed]
    assert said == [(Status.OK, 0, 0, 56), (Status.OK, 4, 0, 56), (Status.NO_ANSWER, 8, 1, 0)]


def test_a_payload_out_of_its_limits_is_refused(bridge):
    del bridge.chip.written[:]
    for name, (kind, *payloads) in BAD_PAYLOADS.items():
        for payload in payloads:
            assert [answer.status for answer in bridge.raw(kind, payload)] == [Status.BAD_PAYLOAD], (name, payload)
    assert bridge.chip.written == []


def test_an_invalid_hello_changes_nothing(fresh):
    for payload in (b"", b"MPUB\1", b"MPUX\1\0\0", b"MPUB\1\0", b"MPUB\1\0\x80"):
        assert [answer.status for answer in fresh.raw(wire.Hello.TYPE, payload)] == [Status.BAD_PAYLOAD], payload
        assert fresh.ask(wire.Read(0x75, 1)).status == Status.NO_HELLO


def test_unknown_requests_are_refused_and_replies_ignored(bridge):
    assert [bridge.frames(Frame(kind, 1).encode()) for kind in range(0x80, 0x100)] == [[]] * 0x80
    unknown = [kind for kind in range(0x80) if kind not in wire.REQUESTS]
    frames = [bridge.frames(Frame(kind, 1).encode())[0] for kind in unknown]
    assert {frame.payload[0] for frame in frames} == {Status.UNKNOWN_TYPE}
    assert [frame.type for frame in frames] == [kind | wire.REPLY_BIT for kind in unknown]


def test_blobs_are_stored_read_replaced_and_erased(bridge):
    assert bridge.stored() is None
    assert bridge.ask(wire.BlobRead(0, 1)).status == Status.NO_BLOB
    for generation, blob in enumerate((BLOB, OTHER, BLOB), 1):
        assert bridge.store(blob).generation == generation
        state = bridge.ask(wire.BlobState())
        assert (state.generation, state.length) == (generation, len(blob))
        assert state.crc == int.from_bytes(blob[-4:], "little")
        assert bridge.stored() == blob
    assert bridge.ask(wire.BlobErase()).status == Status.OK
    assert bridge.stored() is None


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


def test_an_invalid_blob_leaves_the_old_one(bridge):
    bridge.store(OTHER)
    for path in (*VECTORS.glob("blob_bad_*.bin"), VECTORS / "blob_not_finite.bin"):
        assert bridge.store(path.read_bytes()).status == Status.BAD_BLOB, path
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


def test_blob_messages_out_of_order_are_refused(bridge):
    bridge.store(BLOB)
    for name, (requests, status) in OUT_OF_ORDER.items():
        bridge.ask(wire.Hello())
        assert [bridge.ask(request).status for request in requests][-1] == status, name
        assert bridge.stored() == BLOB


def test_a_memory_that_loses_bytes_is_reported(on_core):
    bridge = on_core()
    bridge.ask(wire.Hello())
    bridge.eeprom.stuck.update(range(1024))
    assert bridge.ask(wire.BlobBegin(188)).status == Status.OK
    assert bridge.ask(wire.BlobData(0, BLOB[:32])).status == Status.STORAGE_FAILED


def test_a_write_that_power_cuts_leaves_the_old_blob_in_the_files(tmp_path):
    bridge = on_micropython(tmp_path, Chip())
    bridge.ask(wire.Hello())
    assert [bridge.store(blob).generation for blob in (OTHER, BLOB)] == [1, 2]
    used, _, _ = bridge.files.stored()
    path = Path(bridge.files.paths[used])
    whole = path.read_bytes()
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        assert bridge.files.stored() == (1 - used, 1, OTHER)


def test_other_data_are_given_up_only_by_an_erase(host, on_core):
    others = bytes(range(256)) * 4
    bridge = on_core(eeprom=host.Eeprom(others))

    def occupied():
        return bool(bridge.ask(wire.Hello()).features & wire.Feature.OCCUPIED)

    assert occupied()
    assert bridge.ask(wire.BlobBegin(212)).status == Status.OCCUPIED
    assert bridge.ask(wire.BlobState()).status == Status.NO_BLOB
    assert bridge.ask(wire.BlobData(0, b"x")).status == Status.NOT_BEGUN
    assert bridge.eeprom.content == others
    assert bridge.ask(wire.BlobErase()).status == Status.OK
    assert not occupied()
    assert bridge.ask(wire.BlobBegin(212)).status == Status.OK
    assert bridge.eeprom.content[2 * 264 :] == others[2 * 264 :]


def blob_data(at, size=32):
    return Frame(0x13, 1, wire.BlobData(at, BLOB[at : at + size]).payload())


frames = st.one_of(
    st.builds(Frame, st.sampled_from([*wire.REQUESTS, 0x33]), st.integers(0, 255), st.binary(max_size=66)),
    st.builds(blob_data, st.integers(0, 187)),
    st.builds(lambda size: Frame(0x12, 2, wire.BlobBegin(size).payload()), st.integers(0, 300)),
    st.builds(lambda *how: Frame(0x05, 5, wire.Stream(*how).payload()), st.integers(0, 56), st.integers(1, 32)),
    st.sampled_from(
        [
            Frame(0x12, 2, wire.BlobBegin(188).payload()),
            Frame(0x14, 3, wire.BlobCommit(188, CRC).payload()),
            Frame(0x10, 4),
            *(blob_data(at) for at in range(0, 188, 32)),
        ]
    ),
)


@settings(max_examples=60)
@given(told=st.lists(frames, max_size=25))
def test_both_bridges_answer_alike(told, on_core, tmp_path_factory):
    """Comparison but for what HELLO says, LEAVE of a pasted program alone, and the time of a look at the FIFO."""
    both = on_core(), on_micropython(tmp_path_factory.mktemp("flash"), Chip())
    for frame in [Frame(1, 0, wire.Hello().payload()), *told]:
        if frame.type == wire.Leave.TYPE:
            continue
        ours, theirs = ([each for each in one.frames(frame.encode()) if each.type != wire.Frames.TYPE] for one in both)
        assert [(each.type, each.seq) for each in ours] == [(each.type, each.seq) for each in theirs]
        for our, their in zip(ours, theirs, strict=True):
            assert our.payload[0] == their.payload[0]
            # a failed request's reply may be longer
            if our.payload[0] == Status.OK and frame.type != wire.Hello.TYPE:
                assert our.payload == their.payload


@settings(max_examples=60)
@given(told=st.lists(st.one_of(st.binary(max_size=90), frames.map(Frame.encode)), max_size=30))
def test_the_core_answers_any_bytes_with_replies_alone_and_keeps_its_blob(told, host, core):
    chip = Chip()
    bridge = host.HostBridge(core, host.Eeprom(), chip.read, chip.write)
    asking = Asking(bridge.receive, chip)
    asking.ask(wire.Hello())
    asking.store(BLOB)
    for data in told:
        sent = bridge.receive(data + b"\0")
        bridge.now_us += 700
        deframer = Deframer()
        for frame in deframer.feed(sent + bridge.look()):
            assert frame.type == 0x33 | wire.REPLY_BIT or wire.answer_of(frame.type, frame.payload)
        assert deframer.rejected == 0
    # an ERASE and a whole BEGIN, DATA, COMMIT are within what may come, another blob is not
    assert asking.stored() in (BLOB, None)


def test_the_package_holds_the_golden_exchanges():
    files = VECTORS.glob("exchange_*.json")
    assert exchanges() == {path.stem.removeprefix("exchange_"): json.loads(path.read_text()) for path in files}


STEP = json.loads((VECTORS / "exchange_fifo_count.json").read_text())["steps"][0]


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ([], "0 replies to"),
        ([Frame(0x82, 3, bytes(5) + b"\1\xf8")], "seq 3"),
        ([Frame(0x82, 2, bytes([5, 0, 0, 0, 0]))], "status 5 .NO_ANSWER."),
        ([Frame(0x82, 2, bytes(5) + b"\xf8\1")], "f801 in the reply"),
    ],
)
def test_another_answer_is_described(said, words):
    assert re.search(words, find_difference(STEP, said))


def test_the_build_for_an_uno_has_all_exchanges(switch_on, greeted):
    """The examination of `mpucal doctor --conformance` works with any chip, and erases what it stores."""
    link = greeted(switch_on()[1])
    found = list(examine_conformance(link))
    assert {finding.topic: finding.what for finding in found if finding.mark is not Mark.OK} == {}
    assert {finding.topic for finding in found} == exchanges().keys()
    BlobStore(link).write(BLOB)
    # the stored blob is kept
    left_out = {finding.topic for finding in examine_conformance(link) if finding.mark is Mark.UNKNOWN}
    assert left_out == {name for name, exchange in exchanges().items() if "blob" in exchange["needs"]}
    assert BlobStore(link).read().data == BLOB


def test_a_narrow_clock_is_extended(tmp_path):
    """MicroPython has such a clock; the other bridges do not."""
    vector = json.loads((VECTORS / "clock_30_bits.json").read_text())
    assert vector["bits"] == board.TICKS.bit_length()
    shown = iter(vector["shows"])
    bridge = board.Bridge([Chip()], lambda: next(shown), f"{tmp_path}/")
    begun, *later = vector["t_us"]
    # it may count from any value
    assert [(begun + bridge.clock()) % 2**32 for _ in later] == later


@pytest.mark.parametrize("path", sorted(VECTORS.glob("slots_*.bin")), ids=lambda path: path.stem)
def test_the_later_of_two_blobs_counts(path, host, core):
    wanted = json.loads(path.with_suffix(".json").read_text())
    eeprom = host.Eeprom(path.read_bytes().ljust(1024, b"\xff"))
    memory = ctypes.byref(eeprom.memory)
    stored = core.mpucal_slots_stored(memory)
    assert (stored.generation, stored.at) == (wanted["generation"], 8 + 264 * wanted["stored"])
    at = core.mpucal_slots_open(memory)
    assert core.mpucal_slots_seal(memory, at) == wanted["generation_of_the_next"]
