"""Console of a session on stderr: a screen, lines of text, or lines of JSON."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Protocol

from ..session.boards import BOARD
from ..session.events import Key, Output
from .keys import Keys
from .lines import JsonLines, Lines

# Jupyter sets this variable for its kernels.
KERNEL = "JPY_PARENT_PID"


class Console(Protocol):
    """Interface that shows a session, and returns keys."""

    def hear(self, output: Output) -> None:
        """Show an output."""

    def say(self, text: str) -> None:
        """Show a message."""

    def pressed(self) -> Sequence[Key]:
        """Return the keys that were pressed since the last call; never waits."""

    def listening(self) -> AbstractContextManager[None]:
        """Show the session, and accept keys, Ctrl-C among them, within the context."""

    def hung_up(self, stop: bool) -> None:
        """Handle a terminal that was closed; with `stop`, as if Ctrl-C was pressed."""


def console(
    quiet: bool, as_json: bool = False, beep: bool | None = None, title: str = "", board: str = BOARD
) -> Console:
    """Return the console that stderr and stdin allow.

    Parameters
    ----------
    quiet : accept no keys. as_json : one JSON object a line instead of text.
    beep : ring at each new prompt; None: only on a screen. title : name of the sensor. board : kind of picture.
    """
    term = os.environ.get("TERM", "dumb")
    # A process that a notebook starts has a terminal which shows no screen and sends no keys.
    interactive = KERNEL not in os.environ
    on_screen = interactive and sys.stderr.isatty() and term not in ("", "dumb") and not as_json
    keys = Keys(sys.stdin if interactive and not quiet and sys.stdin.isatty() else None, single=on_screen)
    if as_json:
        return JsonLines(sys.stderr, keys)
    if not on_screen:
        return Lines(sys.stderr, keys, bell=bool(beep))
    from .glyphs import glyphs_of  # noqa: PLC0415 - rich takes a while to load
    from .screen import Screen  # noqa: PLC0415

    return Screen(sys.stderr, keys, glyphs_of(sys.stderr, term), bell=beep is not False, title=title, board=board)
