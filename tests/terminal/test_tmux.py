"""The screen in a real terminal of two sizes, and the terminal afterwards."""

import itertools
import os
import shlex
import subprocess
import sys
import time

import pytest

PATIENCE_S = 60.0
_NUMBERS = itertools.count()
BRAILLE = [chr(dots) for dots in range(0x2801, 0x2900)]


class Tmux:
    """Terminal of a given size, in its own server."""

    def __init__(self, size, folder, environment):
        self._socket, self._folder = f"mpucal-{os.getpid()}-{next(_NUMBERS)}", folder
        told = [f"-e{name}={value}" for name, value in environment.items()]
        self._tmux("-f/dev/null", "new-session", "-d", f"-x{size[0]}", f"-y{size[1]}", *told, "/bin/sh")

    def resize(self, columns, rows):
        self._tmux("resize-window", f"-x{columns}", f"-y{rows}")

    def type(self, *keys):
        self._tmux("send-keys", *keys)

    def run(self, *words):
        modes = "stty -a | grep -o -- '-\\?icanon\\|-\\?echo '"
        self.type(f"{shlex.join(map(str, words))}; echo left with $?; {modes}; printf 'that was %s\\n' all", "Enter")

    def text(self, *options):
        return self._tmux("capture-pane", "-p", *options)

    def is_on_the_second_screen(self):
        return self._tmux("display-message", "-p", "#{alternate_on} #{cursor_flag}").split() == ["1", "0"]

    def wait_for(self, *words, wide=0):
        """Wait until all of `words` are on the screen, and something beyond column `wide`; return its text."""
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            text = self.text()
            if all(word in text for word in words) and max(map(len, text.splitlines())) > wide:
                return text
            time.sleep(0.05)
        raise AssertionError(f"never saw {words} but:\n{text}")

    def close(self):
        self._tmux("kill-server")

    def _tmux(self, *words):
        words = ["tmux", "-L", self._socket, *words]
        return subprocess.run(words, cwd=self._folder, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def terminal(tmp_path, need):
    need("tmux")
    opened = []

    def open_(columns=80, rows=24, **environment):
        opened.append(Tmux((columns, rows), tmp_path, {"PS1": "$ ", **environment}))
        return opened[-1]

    yield open_
    for one in opened:
        one.close()


SESSION = [sys.executable, "-m", "mpucal", "session", "--bus", "sim:pace=real", "-o", "board"]


SHOWN = ("Lay the board flat", "Hz", "°C", "still", "now", "q or Ctrl-C: stop", "mpucal: simulated chip", "██")


def test_a_session_is_shown_and_ctrl_c_restores_the_terminal(terminal):
    tmux = terminal(80, 24)
    tmux.run(*SESSION)
    small = tmux.wait_for(*SHOWN)
    tmux.resize(160, 50)
    large = tmux.wait_for(*SHOWN, wide=80)
    assert tmux.is_on_the_second_screen()
    for text, columns in ((small, 80), (large, 160)):
        assert any(dots in text for dots in BRAILLE)
        assert max(map(len, text.splitlines())) <= columns
    tmux.type("C-c")
    after = tmux.wait_for("left with 4", "that was all")
    assert not tmux.is_on_the_second_screen()
    assert "the session was interrupted" in after
    assert "The capture is kept in board/capture.mcap." in after
    assert "continue with `mpucal session --resume board`" in after.replace("\n", "")
    assert "Traceback" not in after
    assert after.split("left with 4")[1].split()[:2] == ["icanon", "echo"]


def test_no_color_has_no_colour_and_the_q_key_stops_too_and_is_not_left_for_the_shell(terminal):
    tmux = terminal(NO_COLOR="1")
    tmux.run(*SESSION)
    tmux.wait_for("Lay the board flat", "Hz", "q or Ctrl-C: stop")
    coloured = tmux.text("-e")
    assert "\x1b[1m" in coloured
    assert "\x1b[3" not in coloured.replace("\x1b[39m", "")
    tmux.type("q")
    after = tmux.wait_for("left with 4", "that was all")
    assert not after.rstrip().endswith("q")
