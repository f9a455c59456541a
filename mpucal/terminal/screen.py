"""Session on a terminal: a drawing thread shows the latest view."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import TextIO

from ..session.boards import BOARD
from ..session.events import Caution, Decision, Key, Output, Prompt, Verification
from .glyphs import Glyphs
from .keys import Keys
from .layout import lines
from .painter import Painter
from .view import View

# Least time between two pictures: fast enough for the eye, and slow enough for a slow line.
LEAST_INTERVAL_S = 0.16
# Interval after which the drawing thread gives way to the reading loop; Python's own is ten times as long, which could
# cost a FIFO overflow.
SWITCH_INTERVAL_S = 0.0005
# Limit of the wait for a terminal that takes no output any more.
LAST_WORD_S = 1.0
NO_SUSPENSION = "Ctrl-Z cannot suspend a session, which would lose samples", "stop it with q, or go on"


class Screen:
    """Console that draws a session while `listening`; before and afterwards it prints lines.

    Outputs only change the view, and a thread draws the latest one: a terminal that is slow or stopped (Ctrl-S) does
    not delay the reading loop.

    Parameters
    ----------
    out : a terminal. keys : source of key presses. glyphs : characters for `out`. bell : ring at each new prompt.
    title : name of the sensor. board : kind of picture.
    """

    def __init__(
        self, out: TextIO, keys: Keys, glyphs: Glyphs, bell: bool = True, title: str = "", board: str = BOARD
    ) -> None:
        self._out, self._keys, self._glyphs, self._bell = out, keys, glyphs, bell
        self._view = View(f"mpucal: {title}" if title else "mpucal", board)
        self._ring = False
        # Queues, because a signal handler may interrupt a put with another one; the lock of an Event would deadlock.
        self._changed: SimpleQueue[None] = SimpleQueue()
        self._closed: SimpleQueue[None] = SimpleQueue()
        self._open = False
        self._painter = Painter(out)
        self._drawing: threading.Thread | None = None

    def hear(self, output: Output) -> None:
        """Change the view."""
        if isinstance(output, Prompt) and output != self._view.prompt:
            self._ring = self._bell
        self._view = self._view.after(output)
        if isinstance(output, Decision | Verification) and not self._open:
            self.say(f"  {_line_of(output)}")
        self._changed.put(None)

    def say(self, text: str) -> None:
        """Print a message; while the screen is shown, keep it for the end."""
        if self._open:
            self._view = self._view.noted(text.strip())
            self._changed.put(None)
        else:
            print(text, file=self._out, flush=True)

    def pressed(self) -> Sequence[Key]:
        """Return the keys that were pressed since the last call."""
        if self._keys.suspension_refused:
            self._keys.suspension_refused = False
            self.hear(Caution(self._view.now_s or 0.0, "suspended", *NO_SUSPENSION))
        return self._keys.pressed()

    def hung_up(self, stop: bool) -> None:
        """Stop drawing; the messages go to the log in the end. With `stop`, act as at Ctrl-C."""
        self._close()
        if stop:
            self._keys.abort()

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Show the screen within the context; restore the terminal afterwards."""
        self._drawing = threading.Thread(target=self._draw, name="screen", daemon=True)
        usual_s = sys.getswitchinterval()
        with self._keys.listening():
            try:
                sys.setswitchinterval(SWITCH_INTERVAL_S)
                self._painter.show()
                self._open = True
                self._drawing.start()
                yield
            finally:
                self._close()
                sys.setswitchinterval(usual_s)
                self._open = False
                for note in self._view.notes:
                    self.say(f"  {note}")

    def _close(self) -> None:
        """Stop drawing, and restore the terminal; further calls do nothing."""
        self._closed.put(None)
        self._changed.put(None)
        if self._drawing is not None and self._open:
            self._drawing.join(LAST_WORD_S)
        self._painter.give_back()

    def _draw(self) -> None:
        self._changed.put(None)
        while self._closed.empty():
            self._changed.get()
            while not self._changed.empty():
                self._changed.get()
            ring, self._ring = self._ring, False
            size = self._painter.size()
            self._painter.paint(lines(self._view, *size, self._glyphs), size, ring)
            with suppress(Empty):
                self._closed.get(timeout=LEAST_INTERVAL_S)
                return


def _line_of(output: Decision | Verification) -> str:
    return output.why if isinstance(output, Decision) else output.text
