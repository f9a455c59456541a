"""What a host asks and what a bridge answers, of three bridges: the golden talks of firmware_protocol.md."""

from __future__ import annotations

import ctypes
import json
from pathlib import Path

import pytest

from mpucal.chip.access import Reply
from mpucal.simulated.bridge import EmulatedBridge
from mpucal.sources.bridge import board
from mpucal.sources.bridge import messages as wire
from mpucal.sources.bridge.frame import Deframer, Frame
from mpucal.sources.bridge.messages import Status

VECTORS = Path(__file__).parents[2] / "fixtures" / "vectors"
FIFO = {(0x72, 2): b"\x01\xf8"}


class Chip:
    """A chip with 504 bytes in its FIFO; on the buses of two bridges."""

    def read(self, register, count):
        return Reply(FIFO.get((register, count), bytes(count)), 0)

    def readfrom(self, address, count):
        if address != 0x68:
            raise OSError(5)
        return bytes(count)

    def readfrom_mem(self, _address, register, count):
        return self.read(register, count).data


def _core(request, _folder):
    host = request.getfixturevalue("host")

    def read(_address, first, count):
        return Status.OK, Chip().read(first, count).data

    return host.HostBridge(request.getfixturevalue("core"), host.Eeprom(), read, lambda *_: Status.OK).receive


def _emulated(_request, _folder):
    return _working(EmulatedBridge(Chip(), lambda: 0))


def _micropython(_request, folder):
    return _working(board.Bridge([Chip()], lambda: 0, f"{folder}/"))


def _working(bridge):
    def said(data):
        bridge.receive(data)
        return bridge.work()

    return said


@pytest.mark.parametrize("made", [_core, _emulated, _micropython], ids=["the core", "the emulated", "MicroPython's"])
@pytest.mark.parametrize("path", sorted(VECTORS.glob("talk_*.json")), ids=lambda path: path.stem)
def test_answers_as_the_golden_talks_say(path, made, request, tmp_path):
    said = made(request, tmp_path)
    said(Frame(wire.Hello.TYPE, 0, wire.Hello().payload()).encode())
    for each in json.loads(path.read_text())["talk"]:
        frames = [(f.type, f.seq, f.payload) for f in Deframer().feed(said(bytes.fromhex(each["host"])))]
        wanted = each["bridge"] and (
            each["bridge"]["type"],
            each["bridge"]["seq"],
            bytes.fromhex(each["bridge"]["payload"]),
        )
        assert len(frames) == (wanted is not None)
        if wanted:
            (kind, seq, payload), (*head, content) = frames[0], wanted
            assert [kind, seq, payload[0]] == [*head, content[0]]
            assert content[0] != Status.OK or payload[5:] == content[5:]


@pytest.mark.parametrize("path", sorted(VECTORS.glob("slots_*.bin")), ids=lambda path: path.stem)
def test_the_later_of_two_blobs_counts(path, host, core):
    wanted = json.loads(path.with_suffix(".json").read_text())
    eeprom = host.Eeprom(path.read_bytes().ljust(1024, b"\xff"))
    memory = ctypes.byref(eeprom.memory)
    stored = core.mpucal_slots_stored(memory)
    assert (stored.generation, stored.at) == (wanted["generation"], 8 + 264 * wanted["stored"])
    at = core.mpucal_slots_open(memory)
    assert core.mpucal_slots_seal(memory, at) == wanted["generation_of_the_next"]
