import io
import os
import pty
import select
import signal
import threading

import pytest
from rich.text import Text

from mpucal.session.events import Prompt, PromptKind
from mpucal.terminal.keys import Keys
from mpucal.terminal.letters import UNICODE
from mpucal.terminal.screen import Painter, Screen

SHOWN, GIVEN_BACK = "\x1b[?1049h", "\x1b[?1049l"


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self):
        return True

    def taken(self):
        text = self.getvalue()
        self.seek(0)
        self.truncate()
        return text


@pytest.fixture
def out(monkeypatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    return Terminal()


def test_only_rows_that_changed_are_sent(out):
    painter = Painter(out)
    painter.paint([Text("one"), Text("two"), Text("three")], (80, 24))
    text = out.taken()
    assert all(word in text for word in ("one", "two", "three"))
    painter.paint([Text("one"), Text("TWO"), Text("three")], (80, 24))
    assert out.taken() == "\x1b[2;1HTWO\x1b[0m\x1b[K"
    assert painter.paint([Text("one"), Text("TWO"), Text("three")], (80, 24)) == 0


@pytest.mark.parametrize("error", [None, KeyboardInterrupt, ZeroDivisionError], ids=["ends", "Ctrl-C", "fails"])
def test_the_terminal_is_restored_and_the_decisions_are_printed(out, error, session):
    before = threading.active_count()
    screen = Screen(out, Keys(), UNICODE)
    try:
        with screen.listening():
            for output in session:
                screen.hear(output)
            if error:
                raise error
    except (KeyboardInterrupt, ZeroDivisionError):
        pass
    text = out.getvalue()
    assert text.count(SHOWN) == text.count(GIVEN_BACK) == 1
    after = text[text.index(GIVEN_BACK) :]
    assert "\x1b[?25h" in text
    assert "flat and still for 10 s" in after
    assert "the calibration is good" in after
    assert threading.active_count() == before


def drawn(screen, out, words):
    """Wait until the drawing thread has painted `words`."""
    painted = threading.Event()
    for _ in range(200):
        if words in out.getvalue():
            return
        painted.wait(0.05)
    raise AssertionError(f"{words!r} was never drawn")


def test_a_blocked_terminal_does_not_stop_the_session():
    """The session goes on although, after Ctrl-S, the terminal's buffer is full."""
    person, program = pty.openpty()
    os.set_blocking(person, False)
    with os.fdopen(program, "w") as out:
        screen = Screen(out, Keys(), UNICODE)
        with screen.listening():
            blocker = threading.Thread(target=fill, args=(program,), daemon=True)
            blocker.start()
            for k in range(2000):
                screen.hear(Prompt(PromptKind.ROTATE, f"Turn it {k}."))
            assert screen.pressed() == []
            while blocker.is_alive():
                if select.select([person], [], [], 0.1)[0]:
                    os.read(person, 65536)
        while select.select([person], [], [], 0.0)[0]:
            os.read(person, 65536)
    os.close(person)


def fill(handle):
    os.write(handle, b"x" * 200_000)


@pytest.mark.usefixtures("uncollected")
def test_ctrl_z_is_refused_on_the_screen(out):
    person, program = pty.openpty()
    before = signal.getsignal(signal.SIGTSTP)
    with os.fdopen(program, "r+b", buffering=0) as keyboard:
        screen = Screen(out, Keys(keyboard, single=True), UNICODE)
        with screen.listening():
            screen.hear(Prompt(PromptKind.ROTATE, "Turn it."))
            signal.raise_signal(signal.SIGTSTP)
            assert screen.pressed() == []
            drawn(screen, out, "Ctrl-Z cannot suspend a session")
            out.taken()
            assert screen.pressed() == []
    os.close(person)
    assert signal.getsignal(signal.SIGTSTP) is before
