"""A session as lines of text or of JSON, where there is no terminal to draw on."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any, TextIO

from ..session.events import Caution, Decision, Key, Knowledge, Output, Progress, Prompt, PromptKind, Verification
from .keys import Keys
from .words import known, sentence

PROGRESS_EVERY_S = 1.0
KNOWLEDGE_EVERY_S = 5.0
# the same warning is not repeated sooner
CAUTION_EVERY_S = 5.0
HEADINGS = {
    PromptKind.LAY_FLAT: "LAY FLAT",
    PromptKind.ROTATE: "ROTATE",
    PromptKind.VERIFY: "VERIFY",
    PromptKind.AGAIN: "AGAIN?",
    PromptKind.REST: "REST",
}
HOW_TO_ANSWER = "(Enter: go on now; r and Enter: rotate again; q and Enter, or Ctrl-C: stop.)"
BELL = "\a"


class Lines:
    """Says a session in words, a line at a time.

    Parameters
    ----------
    out : where the talk goes. keys : what is pressed. bell : rings at each change of prompt.
    """

    def __init__(self, out: TextIO, keys: Keys, bell: bool = False) -> None:
        self._out, self._keys, self._bell = out, keys, bell
        self._explained = not keys.asked
        self._heard = True
        self._prompt: Prompt | None = None
        self._last = ""
        self._due_s: dict[str, float] = {}

    def hear(self, output: Output) -> None:
        """Say it, where it is worth a line."""
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
        """A line of talk; nobody may be left to hear it, and the session goes on all the same."""
        if self._heard:
            try:
                print(text, file=self._out, flush=True)
            except OSError:
                self._heard = False

    def pressed(self) -> Sequence[Key]:
        """What was pressed since the last call."""
        return self._keys.pressed()

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Meanwhile the first Ctrl-C is a key press; the second one interrupts at once."""
        with self._keys.listening():
            yield

    def hung_up(self, stop: bool) -> None:
        """What follows is heard elsewhere; `stop`: as by Ctrl-C."""
        self._heard = True
        if stop:
            self._keys.abort()

    def _say_prompt(self, prompt: Prompt) -> None:
        """A heading where something else is to be done; else the new words alone."""
        bell = BELL if self._bell and prompt != self._prompt else ""
        goes_on = self._prompt is not None and self._prompt.kind is prompt.kind
        self._prompt = prompt
        if goes_on:
            self.say(f"{bell}  {prompt.text}")
            return
        answer = "" if self._explained else f"\n  {HOW_TO_ANSWER}"
        self._explained = True
        self.say(f"{bell}\n{HEADINGS[prompt.kind]}\n  {prompt.text}{answer}\n")

    def _is_due(self, name: str, t_s: float, every_s: float) -> bool:
        if t_s < self._due_s.get(name, -math.inf) - 1e-6:
            return False
        self._due_s[name] = t_s + every_s
        return True


class JsonLines(Lines):
    """Says every event as one line of JSON, for other front ends: its name in lower case, then its fields."""

    def hear(self, output: Output) -> None:
        """Say it."""
        self._event(type(output).__name__.lower(), asdict(output))

    def say(self, text: str) -> None:
        """A line of talk as an event of its own."""
        self._event("note", {"text": text.strip()})

    def _event(self, name: str, fields: Mapping[str, Any]) -> None:
        super().say(json.dumps({"event": name, **plain(fields)}, allow_nan=False))


def plain(value: Any) -> Any:
    """JSON's own types: what is no finite number becomes null."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
