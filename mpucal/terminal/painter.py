"""Painter of lines on the terminal's alternate screen; it sends only rows that changed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from typing import TextIO

from rich.console import COLOR_SYSTEMS, Console
from rich.segment import Segment
from rich.text import Text

# The alternate screen leaves the terminal's contents as they were; its cursor is hidden.
_SHOW, _GIVE_BACK = "\x1b[?1049h\x1b[?25l\x1b[2J", "\x1b[0m\x1b[?25h\x1b[?1049l"
_ROW, _TO_THE_END = "\x1b[{};1H", "\x1b[0m\x1b[K"
_USUAL = (80, 24)


class Painter:
    """Painter on the stream `out`; rich finds out about its colours and NO_COLOR."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._on_terminal = out.isatty()
        self._console = Console(file=out)
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
            return _USUAL
        return columns or _USUAL[0], rows or _USUAL[1]

    def paint(self, lines: Sequence[Text], size: tuple[int, int], bell: bool = False) -> int:
        """Show `lines` from the top; return the number of characters sent."""
        if size != self._size:
            self._size, self._painted = size, []
        painted = [self._encoded(line) for line in lines]
        before = [*self._painted, *[""] * (len(painted) - len(self._painted))]
        fresh = not self._painted
        rows = [
            f"{_ROW.format(k + 1)}{new}{_TO_THE_END}"
            for k, (old, new) in enumerate(zip(before, painted, strict=False))
            if new != old or fresh
        ]
        self._painted = painted
        text = ("\x1b[2J" if fresh else "") + "".join(rows) + ("\a" if bell else "")
        if text:
            self._send(text)
        return len(text)

    def _encoded(self, line: Text) -> str:
        system = self._console.color_system
        colours = COLOR_SYSTEMS[system] if system else None
        parts = []
        # Text.render applies the styles of spans, but not that of the text itself.
        base = self._console.get_style(line.style)
        for segment in Segment.apply_style(line.render(self._console), base):
            style = segment.style
            if style is None:
                parts.append(segment.text)
                continue
            if self._console.no_color:
                style = style.without_color
            parts.append(style.render(segment.text, color_system=colours))
        return "".join(parts)

    def _send(self, text: str) -> None:
        # Escape sequences must not get into the log that replaces a closed terminal.
        if self._on_terminal and not self._out.isatty():
            return
        with suppress(OSError):
            self._out.write(text)
            self._out.flush()
