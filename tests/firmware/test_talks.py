"""Golden talks of firmware_protocol.md, and others, held with both bridges."""

from __future__ import annotations

import ctypes
import json
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpucal.bridge import board
from mpucal.bridge import messages as wire
from mpucal.bridge.conformance import find_difference, talks
from mpucal.bridge.doctor import examine_conformance
from mpucal.bridge.frame import Deframer, Frame
from mpucal.bridge.messages import Status
from mpucal.bridge.store import BlobStore
from mpucal.chip.access import Reply
from mpucal.doctor.finding import Mark

VECTORS = Path(__file__).parents[2] / "fixtures" / "vectors"
FIFO = {(0x72, 2): b"\x01\xf8"}


class Chip:
    """Chip with 504 bytes in its FIFO, for the buses of both bridges."""

    def read(self, register, count):
        return Reply(FIFO.get((register, count), bytes(count)), 0)

    def readfrom(self, address, count):
        if address != 0x68:
            raise OSError(5)
        return bytes(count)

    def readfrom_mem(self, _address, register, count):
        return self.read(register, count).data

    def writeto_mem(self, _address, register, data):
        pass


def _core(request, _folder, content=b"\xff" * 1024):
    """Return a function from bytes of a host to those of the bridge, and the bridge's memory."""
    host = request.getfixturevalue("host")
    eeprom = host.Eeprom(content)

    def read(address, first, count):
        return asked(address), Chip().read(first, count).data

    def asked(address, *_):
        # 0 is the general call
        return Status.OK if address == 0x68 else Status.BUS_FAILED if address == 0 else Status.NO_ANSWER

    return host.HostBridge(request.getfixturevalue("core"), eeprom, read, asked).receive, eeprom.content


def _micropython(_request, folder):
    return _working(board.Bridge([Chip()], lambda: 0, f"{folder}/")), None


def _working(bridge):
    def said(data):
        bridge.receive(data)
        return bridge.work()

    return said


@pytest.mark.parametrize("made", [_core, _micropython], ids=["the core", "MicroPython's"])
def test_answers_as_the_golden_talks_say(made, request, tmp_path):
    for name, talk in talks().items():
        folder = tmp_path / name
        folder.mkdir()
        said, _ = made(request, folder)
        said(Frame(wire.Hello.TYPE, 0, wire.Hello().payload()).encode())
        for each in talk["talk"]:
            assert find_difference(each, Deframer().feed(said(bytes.fromhex(each["host"])))) == "", name


BLOB = (VECTORS / "blob_measured.bin").read_bytes()
requests = st.lists(
    st.one_of(
        st.builds(Frame, st.sampled_from([*wire.REQUESTS, 0x33]), st.integers(0, 255), st.binary(max_size=66)),
        st.builds(lambda at: Frame(0x13, 1, wire.BlobData(at, BLOB[at : at + 32]).payload()), st.integers(0, 187)),
        st.sampled_from(
            [
                Frame(0x12, 2, wire.BlobBegin(188).payload()),
                Frame(0x14, 3, wire.BlobCommit(188, int.from_bytes(BLOB[-4:], "little")).payload()),
                Frame(0x10, 4),
                Frame(0x05, 5, wire.Stream(14, 2).payload()),
                *(Frame(0x13, 6, wire.BlobData(at, BLOB[at : at + 32]).payload()) for at in range(0, 188, 32)),
            ]
        ),
    ),
    max_size=25,
)


@settings(max_examples=60)
@given(told=requests)
def test_both_bridges_answer_alike(told, request, tmp_path_factory):
    """Comparison but for what HELLO says, LEAVE of a pasted program alone, and the time of a look at the FIFO."""
    (one, _), other = _core(request, None), _micropython(request, tmp_path_factory.mktemp("flash"))[0]
    for frame in [Frame(1, 0, wire.Hello().payload()), *told]:
        if frame.type == wire.Leave.TYPE:
            continue
        ours, theirs = (
            [each for each in Deframer().feed(said(frame.encode())) if each.type != wire.Frames.TYPE]
            for said in (one, other)
        )
        assert [(each.type, each.seq) for each in ours] == [(each.type, each.seq) for each in theirs]
        for our, their in zip(ours, theirs, strict=True):
            assert our.payload[0] == their.payload[0]
            # a failed request's reply may be longer
            if our.payload[0] == Status.OK and frame.type != wire.Hello.TYPE:
                assert our.payload == their.payload


def test_other_data_are_given_up_only_by_an_erase(request, tmp_path):
    others = bytes(range(256)) * 4
    said, memory = _core(request, tmp_path, others)

    def ask(message):
        (frame,) = Deframer().feed(said(Frame(message.TYPE, 1, message.payload()).encode()))
        return wire.answer_of(frame.type, frame.payload)

    def occupied():
        return bool(ask(wire.Hello()).features & wire.Feature.OCCUPIED)

    assert occupied()
    assert ask(wire.BlobBegin(212)).status == Status.OCCUPIED
    assert (ask(wire.BlobState()).status, ask(wire.BlobData(0, b"x")).status) == (Status.NO_BLOB, Status.NOT_BEGUN)
    assert memory == others
    assert ask(wire.BlobErase()).status == Status.OK
    assert not occupied()
    assert ask(wire.BlobBegin(212)).status == Status.OK
    assert memory[2 * 264 :] == others[2 * 264 :]


def test_the_package_holds_the_golden_talks():
    assert talks() == {path.stem[5:]: json.loads(path.read_text()) for path in VECTORS.glob("talk_*.json")}


EXCHANGE = json.loads((VECTORS / "talk_fifo_count.json").read_text())["talk"][0]


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ([], "0 replies to"),
        ([Frame(0x82, 3, bytes(5) + b"\1\xf8")], "seq 3"),
        ([Frame(0x82, 2, bytes([5, 0, 0, 0, 0]))], "status 5 .NO_ANSWER."),
        ([Frame(0x82, 2, bytes(5) + b"\xf8\1")], "f801 in the reply"),
        ([Frame(0x82, 2, bytes(5) + b"\1\xf8")] * 2, "2 replies to"),
    ],
)
def test_another_answer_is_described(said, words):
    assert re.search(words, find_difference(EXCHANGE, said))


def test_the_build_for_an_uno_has_all_talks(switch_on, greeted):
    """The examination of `mpucal doctor --conformance` works with any chip, and erases what it stores."""
    link = greeted(switch_on()[1])
    found = list(examine_conformance(link))
    assert {finding.topic: finding.what for finding in found if finding.mark is not Mark.OK} == {}
    assert {finding.topic for finding in found} == talks().keys()
    BlobStore(link).write((VECTORS / "blob_measured.bin").read_bytes())
    # what is stored there stays
    left_out = {finding.topic for finding in examine_conformance(link) if finding.mark is Mark.UNKNOWN}
    assert left_out == {name for name, talk in talks().items() if "blob" in talk["needs"]}
    assert BlobStore(link).read() == (VECTORS / "blob_measured.bin").read_bytes()


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
