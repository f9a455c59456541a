"""A terminal that goes away in the middle of a session, as a dropped ssh connection makes it."""

import os
import pty
import signal
import sys
import time

from mpucal.files.mcap import read_capture
from mpucal.result.calibration import Calibration

PATIENCE_S = 60.0


def session_on_a_terminal(folder, *options):
    """A session as the foreground of a terminal of its own: its pid and the terminal's other end."""
    pid, terminal = pty.fork()
    if not pid:
        os.chdir(folder)
        os.environ["TERM"] = "xterm"
        words = ["session", "--rate", "50", "-o", "board", *options]
        os.execv(sys.executable, [sys.executable, "-m", "mpucal", *words])
    return pid, terminal


def read_until(terminal, words):
    seen, until = b"", time.monotonic() + PATIENCE_S
    while words not in seen:
        assert time.monotonic() < until, seen[-2000:]
        seen += os.read(terminal, 65536)


def exit_code(pid):
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def test_a_session_ends_in_order_and_says_in_its_log_how_to_go_on(tmp_path):
    pid, terminal = session_on_a_terminal(tmp_path, "--bus", "sim:pace=real")
    read_until(terminal, b"flat on a firm surface")
    time.sleep(1.0)
    os.close(terminal)
    assert exit_code(pid) == 4
    log = (tmp_path / "board" / "session.log").read_text()
    assert "the terminal went away" in log
    assert log.endswith("go on with `mpucal session --resume board` when you are ready.\n")
    capture = read_capture(tmp_path / "board" / "capture.mcap")
    assert capture.recovered is None
    assert capture.records[-1].t_ns > 5e8


def test_a_session_that_keeps_going_gets_its_result(tmp_path):
    pid, terminal = session_on_a_terminal(tmp_path, "--keep-going", "--bus", "sim:seed=3")
    read_until(terminal, b" Hz ")  # it runs so fast that a busy machine may not paint every prompt
    os.close(terminal)
    os.kill(pid, signal.SIGHUP)  # the shell's, after the kernel's
    assert exit_code(pid) == 0
    assert Calibration.load(tmp_path / "board" / "calibration.json").verdict == "good"
    log = (tmp_path / "board" / "session.log").read_text()
    assert "the terminal went away" in log
    assert log.count("flat and still for 10 s: done") == 1
    assert "The calibration is good." in log


def test_a_session_whose_terminal_goes_while_it_waits_for_its_page_goes_on(tmp_path):
    pid, terminal = session_on_a_terminal(tmp_path, "--page", "--bus", "sim:seed=3")
    read_until(terminal, b"Open the page")
    os.close(terminal)
    assert exit_code(pid) == 0
    assert "The calibration is good." in (tmp_path / "board" / "session.log").read_text()
