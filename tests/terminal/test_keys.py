import os
import pty
import select
import signal
import termios

import pytest

from mpucal.session.events import Key
from mpucal.terminal.keys import Keys


def type_(typed, text):
    typed.write(text)
    typed.flush()


def test_keys_are_lines(keyboard):
    typed, lines = keyboard
    keys = Keys(lines)
    assert keys.pressed() == []
    for line, pressed in (
        ("\n", [Key.ENOUGH]),
        (" \n", [Key.ENOUGH]),
        ("r\n", [Key.REDO]),
        ("Q\n", [Key.ABORT]),
        ("what\n", []),
    ):
        type_(typed, line)
        assert keys.pressed() == pressed


def test_keys_are_single_on_a_screen(keyboard):
    typed, lines = keyboard
    keys = Keys(lines, single=True)
    type_(typed, "x\nrR\x1b[Aq")
    assert keys.pressed() == [Key.ENOUGH, Key.REDO, Key.REDO, Key.ABORT]
    assert keys.pressed() == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.usefixtures("uncollected")
def test_the_first_signal_is_a_key_and_the_second_interrupts(number):
    keys = Keys()
    before = signal.getsignal(number)
    with keys.listening():
        signal.raise_signal(number)
        assert keys.pressed() == [Key.ABORT]
        assert keys.pressed() == []
        signal.raise_signal(number)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
    assert signal.getsignal(number) is before


@pytest.fixture
def terminal():
    """Yield a terminal's two ends: the person's and the program's."""
    person, program = pty.openpty()
    with os.fdopen(program, "r+b", buffering=0) as raw, os.fdopen(person, "r+b", buffering=0) as there:
        yield there, raw


@pytest.mark.parametrize("fails", [False, True], ids=["ends", "fails"])
def test_single_keys_are_unseen_and_the_terminal_is_as_before(terminal, fails):
    _, program = terminal
    before = termios.tcgetattr(program)
    keys = Keys(program, single=True)
    try:
        with keys.listening():
            assert not termios.tcgetattr(program)[3] & (termios.ECHO | termios.ICANON)
            assert termios.tcgetattr(program)[3] & termios.ISIG
            if fails:
                raise ZeroDivisionError
    except ZeroDivisionError:
        pass
    assert termios.tcgetattr(program) == before


def test_a_key_that_was_typed_for_the_session_is_not_left_for_the_shell(terminal):
    person, program = terminal
    with Keys(program, single=True).listening():
        person.write(b"x")
        # the kernel hands a key to the program's end a moment later
        assert select.select([program], [], [], 10.0)[0]
    os.set_blocking(program.fileno(), False)
    assert program.read(1) is None
