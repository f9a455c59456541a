"""A session on a terminal: one view that is kept up to date by a drawing thread of its own."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import TextIO

from ..session.events import Decision, Key, Output, Prompt, Verification
from .flat import BOARD
from .glyphs import Glyphs
from .keys import Keys
from .layout import lines
from .painter import Painter
from .view import View

# as often as an eye follows, and a slow line can carry
LEAST_INTERVAL_S = 0.16
# so soon the drawing gives way to the reading loop, which must miss no FIFO for it; Python's own is ten times as long
GIVE_WAY_S = 0.0005
# a terminal that takes no output any more is not waited for longer
LAST_WORD_S = 1.0


class Screen:
    """Shows a session while `listening`; before and afterwards it says lines.

    What is heard only changes the view, and a thread draws the latest one: a terminal that is slow or stopped
    (Ctrl-S) costs the reading loop nothing.

    Parameters
    ----------
    out : a terminal. keys : what is pressed. glyphs : what `out` can show. bell : rings at each change of prompt.
    title : what is measured. board : how it is drawn.
    """

    def __init__(
        self, out: TextIO, keys: Keys, glyphs: Glyphs, bell: bool = True, title: str = "", board: str = BOARD
    ) -> None:
        self._out, self._keys, self._glyphs, self._bell = out, keys, glyphs, bell
        self._view = View(f"mpucal: {title}" if title else "mpucal", board)
        self._ring = False
        # a queue, as SIGHUP may come amid a put, which may be done again then; an event's lock may not
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
        """A line of talk, kept for the end while the screen is shown."""
        if self._open:
            self._view = self._view.noted(text.strip())
            self._changed.put(None)
        else:
            print(text, file=self._out, flush=True)

    def pressed(self) -> Sequence[Key]:
        """What was pressed since the last call."""
        return self._keys.pressed()

    def hung_up(self, stop: bool) -> None:
        """Nothing is drawn any more; what was decided is told elsewhere in the end. `stop`: as by Ctrl-C."""
        self._close()
        if stop:
            self._keys.abort()

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Meanwhile the screen is shown; whatever happens, the terminal is as it was afterwards."""
        self._drawing = threading.Thread(target=self._draw, name="screen", daemon=True)
        gave_way_s = sys.getswitchinterval()
        with self._keys.listening():
            try:
                sys.setswitchinterval(GIVE_WAY_S)
                self._painter.show()
                self._open = True
                self._drawing.start()
                yield
            finally:
                self._close()
                sys.setswitchinterval(gave_way_s)
                self._open = False
                for note in self._view.notes:
                    self.say(f"  {note}")

    def _close(self) -> None:
        """Draw no more, and give the terminal back; once is enough."""
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
