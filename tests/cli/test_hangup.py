"""A terminal that goes away in the middle of a session or measurement, as a dropped ssh connection makes it."""

import os
import pty
import select
import signal
import sys
import time
from pathlib import Path

import pytest

from mpucal.files.mcap import read_capture
from mpucal.result.calibration import Calibration

SESSION = ("session", "--rate", "25", "--target", "quick", "-o", "board")
HELD = str(Path(__file__).with_name("held.py"))
# Time that a busy machine may need for a step of a second or two.
PATIENCE_S = 300.0


class OnATerminal:
    """A command as the foreground of a terminal of its own, held at a step, or run as it is."""

    def __init__(self, folder, *options, held=None, command=SESSION):
        self._folder = folder
        self.pid, self.terminal = pty.fork()
        if not self.pid:
            os.chdir(folder)
            os.environ["TERM"] = "xterm"
            program = ["-m", "mpucal"] if held is None else [HELD, *map(str, held)]
            os.execv(sys.executable, [sys.executable, *program, *command, *options])
        self._until = time.monotonic() + PATIENCE_S
        self._seen = b""
        self.code = None

    def read_until(self, enough):
        """Read what the terminal shows until `enough(text)` is true."""
        while not enough(self._seen):
            assert time.monotonic() < self._until, self._seen[-2000:]
            if select.select([self.terminal], [], [], 0.01)[0]:
                self._seen += os.read(self.terminal, 65536)

    def read_until_held(self):
        self.read_until(lambda seen: (self._folder / "held").exists())

    def let_go(self):
        (self._folder / "go").touch()

    def exit_code(self):
        while self.code is None:
            assert time.monotonic() < self._until
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.code = os.waitstatus_to_exitcode(status)
            time.sleep(0.01)
        return self.code


@pytest.fixture
def on_a_terminal(tmp_path):
    begun = []

    def call(*options, **more):
        begun.append(OnATerminal(tmp_path, *options, **more))
        return begun[-1]

    yield call
    for session in begun:
        if session.code is None:
            os.kill(session.pid, signal.SIGKILL)
            os.waitpid(session.pid, 0)


def test_a_session_ends_in_order_and_says_in_its_log_how_to_go_on(on_a_terminal, tmp_path):
    session = on_a_terminal("--bus", "sim:seed=3", held=("flat", 30))
    session.read_until(lambda seen: b"flat on a firm surface" in seen)
    session.read_until_held()
    os.close(session.terminal)
    session.let_go()
    assert session.exit_code() == 4
    log = (tmp_path / "board" / "session.log").read_text()
    assert "the terminal went away" in log
    assert log.endswith("continue with `mpucal session --resume board` when you are ready.\n")
    capture = read_capture(tmp_path / "board" / "capture.mcap")
    assert capture.recovered is None
    assert capture.records[-1].t_ns > 5e8


def test_a_session_that_keeps_going_gets_its_result(on_a_terminal, tmp_path):
    session = on_a_terminal("--keep-going", "--bus", "sim:seed=3", held=("rotate", 1))
    session.read_until_held()
    os.close(session.terminal)
    # The shell sends SIGHUP as well, after the kernel.
    os.kill(session.pid, signal.SIGHUP)
    session.let_go()
    assert session.exit_code() == 0
    assert Calibration.load(tmp_path / "board" / "calibration.json").verdict == "good"
    log = (tmp_path / "board" / "session.log").read_text()
    assert "the terminal went away" in log
    assert log.count("flat and still for 10 s: done") == 1
    assert "The calibration is good." in log
