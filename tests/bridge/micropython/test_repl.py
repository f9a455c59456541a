"""The real pyserial, and a simulated REPL on a pty: what runs is interrupted, and begins anew at the end."""

import importlib.util
import time
from pathlib import Path

import pytest

from mpucal.__main__ import run
from mpucal.bridge import open_bridge
from mpucal.errors import BusError

BLOB = Path(__file__).parents[3] / "fixtures" / "vectors" / "blob_measured.bin"
CIRCUITPYTHON = b"Adafruit CircuitPython 10.0.3 on 2025-10-17; a board with a chip\r\n"


class I2c:
    def readfrom(self, address, count):
        if address != 0x68:
            raise OSError(5)
        return bytes(count)

    def readfrom_mem(self, address, register, count):
        return bytes([0x68] * count)

    def writeto_mem(self, address, register, data):
        pass


@pytest.fixture
def repl(tmp_path):
    spec = importlib.util.spec_from_file_location("simulated_repl", Path(__file__).with_name("simulated_repl.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    boards = []

    def switch_on(i2c=None, **how):
        boards.append(module.SimulatedRepl(i2c or I2c(), tmp_path, **how))
        return boards[-1]

    yield switch_on
    for each in boards:
        each.stop()


@pytest.mark.parametrize("raw_paste", ["taken", "refused", "unknown"])
def test_a_program_that_runs_gives_way_and_begins_anew(raw_paste, repl):
    board = repl(raw_paste=raw_paste)
    bus = open_bridge(board.name, None, (4, 5))
    assert bus.read(0x75, 1).data == b"\x68"
    assert board.boots == 2
    bus.close()
    until_s = time.monotonic() + 60
    while board.boots < 3 and time.monotonic() < until_s:
        time.sleep(0.01)
    assert board.boots == 3


def test_its_flash_keeps_a_calibration(repl, capsys, tmp_path):
    board, path = repl(), tmp_path / "calibration.bin"
    path.write_bytes(BLOB.read_bytes())
    assert run(["write", str(path), "bridge", "--serial", board.name, "--micropython", "--yes"]) == 0
    assert run(["show", "--serial", board.name, "--micropython"]) == 0
    assert "blob number 1 of the bridge on" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("how", "words"),
    [({}, "MicroPython answers on .*, not a bridge: add --micropython"), ({"banner": CIRCUITPYTHON}, "CircuitPython")],
    ids=["MicroPython", "CircuitPython"],
)
def test_without_the_option_a_repl_is_recognised(how, words, repl):
    with pytest.raises(BusError, match=words):
        open_bridge(repl(**how).name)


def test_a_board_that_cannot_run_it_says_why(repl):
    board = repl()
    board._builtins = dict  # as one without memory: nothing has a name
    with pytest.raises(BusError, match=r"does not run the bridge \(ImportError: __import__ not found\)"):
        open_bridge(board.name, None, ())


def test_pins_are_two(capsys):
    assert run(["show", "--serial", "/dev/ttyACM0", "--micropython=4"]) == 2
    assert "'4' is not two pins, SDA,SCL." in capsys.readouterr().err
