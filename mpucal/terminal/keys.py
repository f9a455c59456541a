"""Key presses: single keys or lines, Ctrl-C, and signals that end the program."""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Callable, Iterator, Sequence
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
# A Ctrl-C that the reading loop has not taken after this time interrupts it: it may hang on a device.
PATIENCE_S = 0.25


class Keys:
    """Keyboard, if there is one, and signals.

    Parameters
    ----------
    keyboard : file to read from; None: there is no keyboard.
    single : read single keys without echo; else lines that end with Enter. Ctrl-Z is then refused.

    Attributes
    ----------
    suspension_refused : set at Ctrl-Z.
    """

    def __init__(self, keyboard: TextIO | None = None, single: bool = False) -> None:
        self._keyboard, self._single = keyboard, single
        self._interrupted = self.suspension_refused = False

    @property
    def has_keyboard(self) -> bool:
        """True if there is a keyboard."""
        return self._keyboard is not None

    def pressed(self) -> Sequence[Key]:
        """Return the keys that were pressed since the last call; never waits."""
        keys = [Key.ABORT] if self._interrupted else []
        self._clear_interrupt()
        while self._keyboard is not None and _has_input(self._keyboard):
            try:
                words = self._typed(self._keyboard)
            except OSError:
                # The terminal was closed.
                words = None
            if words is None:
                self._keyboard = None
            else:
                keys += [_WORDS[word] for word in words if word in _WORDS]
        return keys

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Take the first Ctrl-C as a key press; interrupt at the second one, or if nothing takes the first."""
        with ExitStack() as stack:
            if hasattr(signal, "SIGALRM"):
                stack.callback(signal.signal, signal.SIGALRM, signal.signal(signal.SIGALRM, self._interrupt))
            stack.callback(self._clear_interrupt)
            for number in _ENDING:
                stack.callback(signal.signal, number, signal.signal(number, self._interrupt))
            # The terminal may have been closed before this, as during the wait for a page.
            if self._single and self._keyboard is not None and self._keyboard.isatty():
                stack.enter_context(_single_keys(self._keyboard, self._refuse_suspension))
            yield

    def abort(self) -> None:
        """Act as at the first Ctrl-C."""
        self._interrupted = True

    def _typed(self, keyboard: TextIO) -> list[str] | None:
        """Return the words or keys that are there; None at the end of the input."""
        if (console := _windows()) is not None:
            return _words(console.getwch())
        if not self._single:
            line = keyboard.readline()
            return [line.strip().lower()] if line else None
        data = os.read(keyboard.fileno(), 64)
        return _words(data.decode("latin-1")) if data else None

    def _interrupt(self, _number: int, _frame: FrameType | None) -> None:
        if self._interrupted:
            raise KeyboardInterrupt
        self._interrupted = True
        _set_alarm(PATIENCE_S)

    def _refuse_suspension(self, _number: int, _frame: FrameType | None) -> None:
        self.suspension_refused = True

    def _clear_interrupt(self) -> None:
        _set_alarm(0.0)
        self._interrupted = False


def _set_alarm(seconds: float) -> None:
    """Arm SIGALRM for `seconds`, except on Windows; 0 disarms it."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _windows() -> Any:
    """Return Windows' module for its console, which reads single keys and never lines; None elsewhere."""
    try:
        return import_module("msvcrt")
    except ImportError:
        return None


def _has_input(keyboard: TextIO) -> bool:
    """Return True if a key or line can be read without waiting."""
    console = _windows()
    return bool(console.kbhit() if console is not None else select.select([keyboard], [], [], 0.0)[0])


def _words(keys: str) -> list[str]:
    return [key.strip().lower() for key in keys if key in "\r\n" or key.isalpha()]


@contextmanager
def _single_keys(keyboard: TextIO, on_suspend: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Read single keys without echo within the context; restore the terminal afterwards."""
    if _windows() is not None:
        yield
        return
    import termios  # noqa: PLC0415 - not on Windows
    import tty  # noqa: PLC0415

    handle = keyboard.fileno()
    before = termios.tcgetattr(handle)
    # Ctrl-Z would lose samples, and leave the screen behind.
    stop = signal.signal(signal.SIGTSTP, on_suspend)
    tty.setcbreak(handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTSTP, stop)
        # Keys for the session must not reach the shell, so unread ones are flushed; a closed terminal raises an error.
        with suppress(termios.error):
            termios.tcsetattr(handle, termios.TCSAFLUSH, before)
