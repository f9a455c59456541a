"""The person at a terminal: plain lines out, a line of input in. Knows nothing of what the words mean."""

from __future__ import annotations

import json
import select
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from types import FrameType
from typing import TextIO

from .session.events import Decision, Key, Output, Progress, Prompt, PromptKind

PROGRESS_EVERY_S = 1.0
HEADINGS = {
    PromptKind.LAY_FLAT: "LAY FLAT",
    PromptKind.ROTATE: "ROTATE",
    PromptKind.VERIFY: "VERIFY",
    PromptKind.REST: "REST",
}
KEYS = "(Enter: go on now; q and Enter, or Ctrl-C: stop.)"


class Console:
    """Says what the session says, and asks the keyboard where there is one.

    Parameters
    ----------
    out : where the talk goes. keyboard : where lines are typed; None: nobody types.
    as_json : one JSON object a line in place of words.
    """

    def __init__(self, out: TextIO, keyboard: TextIO | None = None, as_json: bool = False) -> None:
        self._out, self._keyboard, self._as_json = out, keyboard, as_json
        self._interrupted = False
        self._explained = False
        self._progress_s = float("-inf")
        self._line = ""

    def hear(self, output: Output) -> None:
        """Say it."""
        if self._as_json:
            print(
                json.dumps({"event": type(output).__name__.lower(), **asdict(output)}),
                file=self._out,
                flush=True,
            )
            return
        match output:
            case Prompt(kind, text):
                self.say(f"\n{HEADINGS[kind]}\n  {text}{self._keys()}\n")
            case Progress(t_s, _, _, text) if t_s - self._progress_s >= PROGRESS_EVERY_S - 1e-6:
                self._progress_s = t_s
                self._show(f"  {text}")
            case Decision(why):
                self.say(f"  {why}")

    def say(self, text: str) -> None:
        """A line of talk."""
        self._end_line()
        print(text, file=self._out, flush=True)

    def pressed(self) -> Sequence[Key]:
        """What was pressed since the last call."""
        keys = [Key.ABORT] if self._interrupted else []
        self._interrupted = False
        while self._keyboard is not None and select.select([self._keyboard], [], [], 0.0)[0]:
            line = self._keyboard.readline()
            if not line:
                self._keyboard = None
            elif line.strip().lower() in ("q", "quit"):
                keys.append(Key.ABORT)
            elif not line.strip():
                keys.append(Key.ENOUGH)
        return keys

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Meanwhile the first Ctrl-C is a key press; the second one interrupts at once."""
        before = signal.signal(signal.SIGINT, self._interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)
            self._end_line()

    def _interrupt(self, _number: int, _frame: FrameType | None) -> None:
        if self._interrupted:
            raise KeyboardInterrupt
        self._interrupted = True

    def _keys(self) -> str:
        """How to answer, said once."""
        if self._keyboard is None or self._explained:
            return ""
        self._explained = True
        return f"\n  {KEYS}"

    def _show(self, text: str) -> None:
        """A line that the next one replaces; where there is no terminal, a line of its own if it is new."""
        if self._out.isatty():
            print(f"\r{text.ljust(len(self._line))}", end="", file=self._out, flush=True)
        elif text != self._line:
            print(text, file=self._out, flush=True)
        self._line = text

    def _end_line(self) -> None:
        if self._line and self._out.isatty():
            print(file=self._out, flush=True)
        self._line = ""


def console(quiet: bool, as_json: bool = False) -> Console:
    """The console of this process; `quiet`: nobody is asked anything."""
    typed = None if quiet or not sys.stdin.isatty() else sys.stdin
    return Console(sys.stderr, typed, as_json)
