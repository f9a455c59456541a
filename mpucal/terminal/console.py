"""Chooses how a session talks on stderr: a screen, lines of text, or lines of JSON."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Protocol

from ..session.events import Key, Output
from .flat import BOARD
from .keys import Keys
from .lines import JsonLines, Lines

# Jupyter sets it for its kernels
KERNEL = "JPY_PARENT_PID"


class Console(Protocol):
    """Says what the session says, and asks the keyboard where there is one."""

    def hear(self, output: Output) -> None:
        """Be told."""
        ...

    def say(self, text: str) -> None:
        """A line of talk."""
        ...

    def pressed(self) -> Sequence[Key]:
        """What was pressed since the last call; never waits."""
        ...

    def listening(self) -> AbstractContextManager[None]:
        """Meanwhile the person is shown the session and may press keys, Ctrl-C among them."""
        ...

    def hung_up(self, stop: bool) -> None:
        """The terminal went away; `stop` the session for it."""
        ...


def console(
    quiet: bool, as_json: bool = False, beep: bool | None = None, title: str = "", board: str = BOARD
) -> Console:
    """The console on stderr and stdin.

    Parameters
    ----------
    quiet : nobody is asked anything. as_json : one JSON object a line in place of words.
    beep : ring at each change of prompt; None: where there is a screen. title : what is measured.
    board : how it is drawn.
    """
    term = os.environ.get("TERM", "dumb")
    # what a cell of a notebook starts has a terminal that shows no screen and hears no keys
    seen = KERNEL not in os.environ
    drawn = seen and sys.stderr.isatty() and term not in ("", "dumb") and not as_json
    keys = Keys(sys.stdin if seen and not quiet and sys.stdin.isatty() else None, single=drawn)
    if as_json:
        return JsonLines(sys.stderr, keys)
    if not drawn:
        return Lines(sys.stderr, keys, bell=bool(beep))
    from .glyphs import glyphs_of  # noqa: PLC0415 - draws with rich, which takes a while to load
    from .screen import Screen  # noqa: PLC0415

    return Screen(sys.stderr, keys, glyphs_of(sys.stderr, term), bell=beep is not False, title=title, board=board)
