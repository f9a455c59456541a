"""The command line on a board with an emulated bridge: record, store, show."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from mpucal import bridge
from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.doctor import examine_bridge_and_chip, exchanges
from mpucal.chip.config import Config
from mpucal.doctor.finding import Mark
from mpucal.errors import BusError, OutputError
from mpucal.result.calibration import Calibration
from mpucal.session.events import Prompt, PromptKind
from mpucal.session.plan import Plan
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.bus import FastClock
from mpucal.sources.chip import OpenedChip
from tools.lab.bridge import EmulatedBridge, EmulatedLine, Memory

MS = 1_000_000
BLOB = Path(__file__).parents[2] / "fixtures" / "vectors" / "blob_measured.bin"


@pytest.fixture
def board(monkeypatch):
    """A bridge on a line that replaces every serial port; its memory outlives it."""
    made = SimpleNamespace(memory=Memory(), clock=FastClock(), name="/dev/ttyUSB0")
    made.chip = open_simulated("sim:seed=5", clock=made.clock)
    made.line = EmulatedLine(EmulatedBridge(made.chip, made.clock.now, made.memory), made.clock, step_ns=MS)
    made.line.name = made.name
    monkeypatch.setattr(bridge, "SerialPort", lambda _text: made.line)
    return made


def test_a_recording(board, mpucal):
    mpucal("record", "--serial", board.name, "-o", "board.mcap", "--seconds", "1", "--rate", "1000", code=0)
    shown = json.loads(mpucal("show", "board.mcap", "--json").out)
    assert (shown["gaps"], shown["samples"] > 900) == (0, True)


def test_a_capture_without_its_suffix_is_refused_at_once(board, mpucal, tmp_path):
    refused = mpucal("record", "--serial", board.name, "-o", "plain", "--seconds", "1", code=OutputError.exit_code)
    assert "plain does not end with .mcap" in refused.err
    assert not (tmp_path / "plain").exists()


def test_into_the_memory_and_back(board, mpucal, tmp_path):
    nothing = mpucal("show", "--serial", board.name, code=BusError.exit_code)
    assert f"the bridge on {board.name} stores no calibration: store one: mpucal write" in nothing.err
    made = Calibration.load(BLOB)
    made.save("calibration.json")
    board.memory.slots[0] = b"another sketch's"
    stored = mpucal("write", "calibration.json", "bridge", "--serial", board.name, "--yes", code=0)
    assert "holds other data, perhaps another sketch's or file system's, which a write overwrites" in stored.err
    assert "as its blob number 1 (212 bytes, CRC-32 " in stored.out
    # another bridge with the same memory: the power was off
    board.line.device = EmulatedBridge(board.chip, board.clock.now, board.memory)
    shown = mpucal("show", "--serial", board.name, "--json", code=0)
    kept = json.loads(shown.out)["accelerometer"]
    assert (kept["D"], kept["b_a"]) == (made.D.tolist(), made.b_a.tolist())
    shown = mpucal("show", "--serial", board.name)
    assert "blob number 1 of the bridge on" in shown.out
    anew = mpucal("write", "calibration.json", "bridge", "--serial", board.name, "-o", "kept")
    assert "bridge-blob-1.bin" in anew.err
    assert (tmp_path / "kept" / "bridge-blob-1.bin").read_bytes() == made.blob().encode()


def test_the_doctor_tells_bridge_and_chip():
    clock = FastClock()
    chip = open_simulated("sim:seed=5", clock=clock)
    bus = BridgeBus(EmulatedLine(EmulatedBridge(chip, clock.now), clock, step_ns=2_000_000))
    chip.hear(Prompt(PromptKind.LAY_FLAT, ""))
    source = OpenedChip(bus, Plan(Config()), (chip.hear,))
    found = {finding.topic: finding for finding in examine_bridge_and_chip(source, 2.0)}
    assert not [finding for finding in found.values() if finding.mark is Mark.BAD]
    assert found["bridge"].data["name"] == "emulated bridge"
    assert found["bridge"].data["pushes"]
    assert found["offset registers"].data["place"] == 0x06
    # the speed of the chip's bus is unknown behind a serial line
    assert "serial line" in found
    assert "bus speed" not in found


def test_the_doctor_holds_the_firmware_to_the_protocol(board, mpucal):
    done = mpucal("doctor", "--serial", board.name, "--conformance", "--json", code=0)
    assert {finding["topic"]: finding["mark"] for finding in json.loads(done.out)["findings"]} == dict.fromkeys(
        exchanges(), "ok"
    )
    board.memory.slots[0] = b"another sketch's"
    held = list(board.memory.slots)
    done = mpucal("doctor", "--serial", board.name, "--conformance", "--json")
    tried = {finding["topic"]: finding["what"] for finding in json.loads(done.out)["findings"]}
    assert "not tried, as its memory holds other data" in tried["begin_of_0"]
    assert board.memory.slots == held
    assert "for the firmware of a bridge" in mpucal("doctor", "--bus", "sim", "--conformance").err
