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
        due = each["bridge"] if isinstance(each["bridge"], list) else [each["bridge"]] * (each["bridge"] is not None)
        assert len(frames) == len(due)
        for (kind, seq, payload), wanted in zip(frames, due, strict=True):
            content = bytes.fromhex(wanted["payload"])
            assert (kind, seq, payload[0]) == (wanted["type"], wanted["seq"], content[0])
            assert content[0] != Status.OK or payload[5:] == content[5:]


def test_a_narrow_clock_is_extended(tmp_path):
    """MicroPython's; others have no narrower one."""
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
