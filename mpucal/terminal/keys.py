"""Key presses: single keys or lines of them, Ctrl-C, and signals that end the program."""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from types import FrameType
from typing import Any, TextIO

from ..session.events import Key

_WORDS = {
    "": Key.ENOUGH,
    "r": Key.REDO,
    "redo": Key.REDO,
    "q": Key.ABORT,
    "quit": Key.ABORT,
}
_ENDING = (signal.SIGINT, signal.SIGTERM)
_AT_ONCE = 64
# so long a Ctrl-C waits for who reads the sensor, who may hang on a device
PATIENCE_S = 0.25


class Keys:
    """The keyboard, where there is one, and the signals.

    Parameters
    ----------
    keyboard : where the person types; None: nobody types.
    single : each key counts by itself, and none is echoed; else a line counts when Enter ends it.
    """

    def __init__(self, keyboard: TextIO | None = None, single: bool = False) -> None:
        self._keyboard, self._single = keyboard, single
        self._interrupted = False

    @property
    def asked(self) -> bool:
        """Whether anybody can type."""
        return self._keyboard is not None

    def pressed(self) -> Sequence[Key]:
        """What was pressed since the last call; never waits."""
        keys = [Key.ABORT] if self._interrupted else []
        self._heard()
        while self._keyboard is not None and _waits(self._keyboard):
            try:
                words = self._typed(self._keyboard)
            except OSError:  # the terminal went away
                words = None
            if words is None:
                self._keyboard = None
            else:
                keys += [_WORDS[word] for word in words if word in _WORDS]
        return keys

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Meanwhile the first Ctrl-C is a key press; the second one, or nobody who takes the first, interrupts."""
        with ExitStack() as stack:
            if hasattr(signal, "SIGALRM"):
                stack.callback(signal.signal, signal.SIGALRM, signal.signal(signal.SIGALRM, self._interrupt))
            stack.callback(self._heard)
            for number in _ENDING:
                stack.callback(signal.signal, number, signal.signal(number, self._interrupt))
            # a terminal may go away before anybody listens, as while a page is waited for
            if self._single and self._keyboard is not None and self._keyboard.isatty():
                stack.enter_context(_without_lines(self._keyboard))
            yield

    def abort(self) -> None:
        """As Ctrl-C does the first time."""
        self._interrupted = True

    def _typed(self, keyboard: TextIO) -> list[str] | None:
        """The words or keys that are there; None where there will never be any more."""
        if (console := _windows()) is not None:
            return _words(console.getwch())
        if not self._single:
            line = keyboard.readline()
            return [line.strip().lower()] if line else None
        data = os.read(keyboard.fileno(), _AT_ONCE)
        return _words(data.decode("latin-1")) if data else None

    def _interrupt(self, _number: int, _frame: FrameType | None) -> None:
        if self._interrupted:
            raise KeyboardInterrupt
        self._interrupted = True
        _alarm(PATIENCE_S)

    def _heard(self) -> None:
        _alarm(0.0)
        self._interrupted = False


def _alarm(seconds: float) -> None:
    """A signal after so long, on systems that have it; 0: none."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _windows() -> Any:
    """Windows' module for its console, which gives single keys and never lines; None elsewhere."""
    try:
        return import_module("msvcrt")
    except ImportError:
        return None


def _waits(keyboard: TextIO) -> bool:
    """Whether a key or line is there."""
    console = _windows()
    return bool(console.kbhit() if console is not None else select.select([keyboard], [], [], 0.0)[0])


def _words(keys: str) -> list[str]:
    return [key.strip().lower() for key in keys if key in "\r\n" or key.isalpha()]


@contextmanager
def _without_lines(keyboard: TextIO) -> Iterator[None]:
    """Keys come one by one and unseen; whatever happens, lines come again afterwards."""
    if _windows() is not None:
        yield
        return
    import termios  # noqa: PLC0415 - not everywhere is there a terminal
    import tty  # noqa: PLC0415

    handle = keyboard.fileno()
    before = termios.tcgetattr(handle)
    # who is stopped by Ctrl-Z loses samples, and leaves a screen behind
    stop = signal.signal(signal.SIGTSTP, signal.SIG_IGN)
    tty.setcbreak(handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTSTP, stop)
        # what was typed for the session is not meant for the shell; a terminal that went away has neither
        with suppress(termios.error):
            termios.tcsetattr(handle, termios.TCSAFLUSH, before)
