import io
import os
import signal

import pytest

from mpucal.console import Console
from mpucal.session.events import Decision, Key, Progress, Prompt, PromptKind


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def keyboard():
    """What is typed, and where it is read."""
    reader, writer = os.pipe()
    with os.fdopen(reader) as lines, os.fdopen(writer, "w") as typed:
        yield typed, lines


def test_a_prompt_is_large_and_plain():
    out = io.StringIO()
    Console(out).hear(Prompt(PromptKind.ROTATE, "Now turn it."))
    assert out.getvalue() == "\nROTATE\n  Now turn it.\n\n"


def test_progress_comes_once_a_second_at_most():
    out = io.StringIO()
    console = Console(out)
    for k in range(40):
        console.hear(Progress(100.0 + 0.25 * k, k, 40, f"step {k}"))
    assert out.getvalue().split() == [word for k in range(0, 40, 4) for word in ("step", str(k))]


def test_without_a_terminal_a_line_that_says_nothing_new_is_left_out():
    out = io.StringIO()
    console = Console(out)
    for k in range(5):
        console.hear(Progress(float(k), 0, 12, "waiting"))
    assert out.getvalue() == "  waiting\n"


def test_on_a_terminal_progress_stays_on_its_line_until_something_else_is_said():
    out = Terminal()
    console = Console(out)
    console.hear(Progress(0.0, 0, 12, "a long line"))
    console.hear(Progress(1.0, 1, 12, "short"))
    console.hear(Decision("enough"))
    assert out.getvalue() == "\r  a long line\r  short      \n  enough\n"


def test_keys_are_lines(keyboard):
    typed, lines = keyboard
    console = Console(io.StringIO(), lines)
    assert console.pressed() == []
    for line, keys in (("\n", [Key.ENOUGH]), (" \n", [Key.ENOUGH]), ("q\n", [Key.ABORT]), ("what\n", [])):
        typed.write(line)
        typed.flush()
        assert console.pressed() == keys


def test_a_keyboard_that_went_away_says_nothing(keyboard):
    typed, lines = keyboard
    console = Console(io.StringIO(), lines)
    typed.close()
    assert console.pressed() == []
    assert console.pressed() == []


def test_keys_are_explained_once_where_there_is_a_keyboard(keyboard):
    for lines, times in ((None, 0), (keyboard[1], 1)):
        out = io.StringIO()
        console = Console(out, lines)
        for _ in range(2):
            console.hear(Prompt(PromptKind.LAY_FLAT, "Lay it down."))
        assert out.getvalue().count("Enter: go on") == times


def test_the_first_ctrl_c_is_a_key_and_the_second_interrupts():
    console = Console(io.StringIO())
    before = signal.getsignal(signal.SIGINT)
    with console.listening():
        signal.raise_signal(signal.SIGINT)
        assert console.pressed() == [Key.ABORT]
        assert console.pressed() == []
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before
