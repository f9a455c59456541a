"""Session on a terminal: a drawing thread shows the latest view, and sends only rows that changed."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import TextIO

from rich.console import COLOR_SYSTEMS, Console
from rich.segment import Segment
from rich.text import Text

from ..session.boards import BOARD
from ..session.events import Caution, Decision, Key, Output, Prompt, Verification
from .keys import Keys
from .layout import lines
from .letters import Glyphs
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
            self.say(f"  {output.why if isinstance(output, Decision) else output.text}")
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


# The alternate screen leaves the terminal's contents as they were; its cursor is hidden.
_SHOW, _GIVE_BACK = "\x1b[?1049h\x1b[?25l\x1b[2J", "\x1b[0m\x1b[?25h\x1b[?1049l"
_ROW, _TO_THE_END = "\x1b[{};1H", "\x1b[0m\x1b[K"


class Painter:
    """Painter on the stream `out`; rich finds out about its colours and NO_COLOR."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._on_terminal = out.isatty()
        self._console = Console(file=out)
        self._colours = COLOR_SYSTEMS.get(self._console.color_system or "")
        self._painted: list[str] = []
        self._size = (0, 0)
        self._shown = False

    def show(self) -> None:
        """Switch to the alternate screen."""
        self._shown = True
        self._send(_SHOW)

    def give_back(self) -> None:
        """Restore the terminal; further calls do nothing."""
        if self._shown:
            self._shown = False
            self._painted = []
            self._send(_GIVE_BACK)

    def size(self) -> tuple[int, int]:
        """Return columns and rows, which may change at any time."""
        try:
            columns, rows = os.get_terminal_size(self._out.fileno())
        except (OSError, ValueError):
            columns = rows = 0
        # A terminal that does not tell has the usual size.
        return columns or 80, rows or 24

    def paint(self, lines: Sequence[Text], size: tuple[int, int], bell: bool = False) -> int:
        """Show `lines` from the top; return the number of characters sent."""
        if size != self._size:
            self._size, self._painted = size, []
        painted = [self._encoded(line) for line in lines]
        fresh = len(self._painted) != len(painted)
        rows = [
            f"{_ROW.format(k + 1)}{new}{_TO_THE_END}"
            for k, new in enumerate(painted)
            if fresh or new != self._painted[k]
        ]
        self._painted = painted
        text = ("\x1b[2J" if fresh else "") + "".join(rows) + ("\a" if bell else "")
        if text:
            self._send(text)
        return len(text)

    def _encoded(self, line: Text) -> str:
        # Text.render applies the styles of spans, but not that of the text itself.
        segments = Segment.apply_style(line.render(self._console), self._console.get_style(line.style))
        if self._console.no_color:
            segments = Segment.remove_color(segments)
        return "".join(style.render(text, color_system=self._colours) if style else text for text, style, _ in segments)

    def _send(self, text: str) -> None:
        # Escape sequences must not get into the log that replaces a closed terminal.
        if self._on_terminal and not self._out.isatty():
            return
        with suppress(OSError):
            self._out.write(text)
            self._out.flush()
