"""Session as lines of text or of JSON, where there is no terminal to draw on."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any, TextIO

from ..session.events import Caution, Decision, Key, Knowledge, Output, Progress, Prompt, Verification
from .keys import Keys
from .view import HEADLINES
from .words import known, sentence

PROGRESS_EVERY_S = 1.0
KNOWLEDGE_EVERY_S = 5.0
# Least time between two cautions of one kind.
CAUTION_EVERY_S = 5.0
KEYS = "(Enter: skip ahead; r and Enter: restart the turning; q and Enter, or Ctrl-C: stop.)"
BELL = "\a"


class Lines:
    """Console that prints lines of text.

    Parameters
    ----------
    out : stream to print on. keys : source of key presses. bell : ring at each new prompt.
    """

    def __init__(self, out: TextIO, keys: Keys, bell: bool = False) -> None:
        self._out, self._keys, self._bell = out, keys, bell
        self._explained = not keys.has_keyboard
        self._open = True
        self._prompt: Prompt | None = None
        self._last = ""
        self._due_s: dict[str, float] = {}

    def hear(self, output: Output) -> None:
        """Print an output, unless it is repeated too soon."""
        match output:
            case Prompt():
                self._say_prompt(output)
            case Progress(t_s, _, _, text) if text != self._last and self._is_due("progress", t_s, PROGRESS_EVERY_S):
                self._last = text
                self.say(f"  {text}")
            case Knowledge() if self._is_due("knowledge", output.t_s, KNOWLEDGE_EVERY_S):
                self.say(f"  {known(output)}")
            case Caution(t_s, code, what, do) if self._is_due(code, t_s, CAUTION_EVERY_S):
                self.say(f"  ! {sentence(what)} {sentence(do)}")
            case Verification():
                self.say(f"  {output.text}")
            case Decision(why):
                self.say(f"  {why}")

    def say(self, text: str) -> None:
        """Print a line; once the stream is closed, print nothing, so that the session goes on."""
        if self._open:
            try:
                print(text, file=self._out, flush=True)
            except OSError:
                self._open = False

    def pressed(self) -> Sequence[Key]:
        """Return the keys that were pressed since the last call."""
        return self._keys.pressed()

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Take the first Ctrl-C as a key press within the context; see Keys."""
        with self._keys.listening():
            yield

    def hung_up(self, stop: bool) -> None:
        """Print on the log from now on; with `stop`, act as at Ctrl-C."""
        self._open = True
        if stop:
            self._keys.abort()

    def _say_prompt(self, prompt: Prompt) -> None:
        """Print a heading and the prompt; the prompt alone if its kind is that of the last one."""
        bell = BELL if self._bell and prompt != self._prompt else ""
        goes_on = self._prompt is not None and self._prompt.kind is prompt.kind
        self._prompt = prompt
        if goes_on:
            self.say(f"{bell}  {prompt.text}")
            return
        keys = "" if self._explained else f"\n  {KEYS}"
        self._explained = True
        self.say(f"{bell}\n{HEADLINES[prompt.kind]}\n  {prompt.text}{keys}\n")

    def _is_due(self, name: str, t_s: float, every_s: float) -> bool:
        if t_s < self._due_s.get(name, -math.inf) - 1e-6:
            return False
        self._due_s[name] = t_s + every_s
        return True


class JsonLines(Lines):
    """Console that prints each output as a line of JSON, for other front ends: its name in lower case, its fields."""

    def hear(self, output: Output) -> None:
        """Print an output."""
        self._event(type(output).__name__.lower(), asdict(output))

    def say(self, text: str) -> None:
        """Print a message as the event `note`."""
        self._event("note", {"text": text.strip()})

    def _event(self, name: str, fields: Mapping[str, Any]) -> None:
        super().say(json.dumps({"event": name, **plain(fields)}, allow_nan=False))


def plain(value: Any) -> Any:
    """Return a value in JSON's own types; numbers that are not finite become None."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
